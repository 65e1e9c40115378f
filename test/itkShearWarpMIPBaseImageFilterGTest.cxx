/*=========================================================================
 *
 *  Copyright NumFOCUS
 *
 *  Licensed under the Apache License, Version 2.0 (the "License");
 *  you may not use this file except in compliance with the License.
 *  You may obtain a copy of the License at
 *
 *         https://www.apache.org/licenses/LICENSE-2.0.txt
 *
 *  Unless required by applicable law or agreed to in writing, software
 *  distributed under the License is distributed on an "AS IS" BASIS,
 *  WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
 *  See the License for the specific language governing permissions and
 *  limitations under the License.
 *
 *=========================================================================*/
#include "itkShearWarpMIPCineImageFilter.h"
#include "itkShearWarpMIPImageFilter.h"

#include "itkShearWarpMIPTestParts.h"

#include <stdexcept>

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#  if __GLIBC__ > 2 || __GLIBC_MINOR__ >= 33
#    include <malloc.h>
#    define HAS_MALLINFO2
#  endif
#endif

namespace
{
using namespace itk::ShearWarpMIPTest;

using ImageType = itk::Image<short, 3>;
using SingleType = itk::ShearWarpMIPImageFilter<ImageType>;
using CineType = itk::ShearWarpMIPCineImageFilter<ImageType>;
using PartsType = itk::ShearWarpMIPPartsImageFilter<ImageType>;
using ModeEnum = itk::ShearWarpMIPImageFilterEnums::Mode;

ImageType::Pointer
MakeTestImage(itk::SizeValueType length = 44)
{
  Random     random(1201);
  const auto image = MakePlainImage<short>({ { length, length, length } });
  FillRandom(random, image.GetPointer());
  return image;
}

/** Along x and, for a cine, along y too. */
ViewType::Pointer
MakeTestView()
{
  return MakeView(MakeMatrix({ { 0.1, 0.2, 1 }, { 1, 0, 0.3 }, { 0, 1, 0.2 } }), PointType(0.0));
}

/** Of the process; 0 if the C library does not tell. */
std::size_t
CountAllocatedBytes()
{
#ifdef HAS_MALLINFO2
  return mallinfo2().uordblks + mallinfo2().hblkhd;
#else
  return 0;
#endif
}

template <typename TFilter>
using Change = std::function<void(TFilter *)>;

/** Gives \a filter an input with voxels that nobody else holds. */
template <typename TFilter>
void
Configure(TFilter * filter)
{
  filter->SetInput(MakeTestImage());
  filter->SetTransform(MakeTestView());
  filter->GetMultiThreader()->SetMaximumNumberOfThreads(8);
  filter->SetNumberOfWorkUnits(2);
  if constexpr (std::is_base_of_v<CineType, TFilter>)
  {
    filter->SetNumberOfFrames(6);
  }
}

template <typename TFilter>
typename TFilter::Pointer
MakeConfigured()
{
  const auto filter = TFilter::New();
  Configure<TFilter>(filter);
  return filter;
}

template <typename TFilter>
void
ConfigureRays(TFilter * filter)
{
  Configure(filter);
  filter->SetMaskImage(MakePlainImage<unsigned char>({ { 44, 44, 44 } }, 1));
  filter->ComputeDepthOn();
}

template <typename TFilter>
void
ConfigureExact(TFilter * filter)
{
  Configure(filter);
  filter->SetInput(MakeTestImage(20));
  filter->ExactOn();
}

template <typename TFilter>
void
ConfigureStreamed(TFilter * filter)
{
  Configure(filter);
  // the filter does not hold its sources
  static ImageType::Pointer         image;
  static PartSource<short>::Pointer source;
  image = MakeTestImage();
  source = MakeSource<short>(image);
  filter->SetInput(source->GetOutput());
  filter->SetNumberOfStreamDivisions(4);
}

/** What changes no picture. */
template <typename TFilter>
const Change<TFilter> HarmlessChanges[] = {
  [](TFilter * filter) { filter->SetNumberOfWorkUnits(8); },
  [](TFilter * filter) { filter->SetNumberOfWorkUnits(1); },
  [](TFilter * filter) { filter->GetMultiThreader()->SetNumberOfWorkUnits(8); },
  [](TFilter * filter) { filter->GetMultiThreader()->SetMaximumNumberOfThreads(1); },
  [](TFilter * filter) { filter->SetMultiThreader(itk::MultiThreaderBase::New()); },
  [](TFilter * filter) { filter->ReleasePreparedVolume(); },
  [](TFilter * filter) { filter->UpdateOutputInformation(); },
  [](TFilter * filter) { filter->Update(); },
  [](TFilter * filter) { filter->SetIntermediateMemory(1); }
};

/** What changes the next picture. */
template <typename TFilter>
const Change<TFilter> ChangesOfParameters[] = {
  [](TFilter * filter) { filter->SetTransform(ViewType::New()); },
  [](TFilter * filter) {
    const_cast<ViewType *>(dynamic_cast<const ViewType *>(filter->GetTransform()))->SetMatrix(MakeDiagonal(1, 2, 3));
  },
  [](TFilter * filter) { filter->SetOversampling(2); },
  [](TFilter * filter) { filter->SetNumberOfStreamDivisions(5); },
  [](TFilter * filter) { filter->SetMode(ModeEnum::Minimum); },
  [](TFilter * filter) { filter->SetSlabFar(1.0); },
  [](TFilter * filter) { filter->SetCropLower(MakePoint3(1, 2, 3)); },
  [](TFilter * filter) { filter->SetDefaultPixelValue(7); },
  [](TFilter * filter) { filter->SetSize({ { 200, 200 } }); },
  [](TFilter * filter) { filter->SetOutputSpacing(MakeVector2(1.5, 0.75)); },
  [](TFilter * filter) { filter->SetDepthAttenuation(0.1); },
  [](TFilter * filter) { filter->LocalMaximumOn(); },
  [](TFilter * filter) { filter->SetMaskLabel(3); },
  [](TFilter * filter) { filter->SetExact(!filter->GetExact()); },
  [](TFilter * filter) {
    filter->SetMode(ModeEnum::Minimum);
    GetExceptionDescription([filter] { filter->UpdateOutputInformation(); });
  }
};

/** What changes the next picture and, if it comes before the first voxel is read, is an error. */
template <typename TFilter>
const Change<TFilter> ChangesOfObjects[] = {
  [](TFilter * filter) { filter->SetInput(MakeTestImage(21)); },
  [](TFilter * filter) { filter->SetInput(nullptr); },
  [](TFilter * filter) { filter->SetComputeDepth(!filter->GetComputeDepth()); },
  [](TFilter * filter) {
    filter->SetMaskImage(filter->GetMaskImage() ? nullptr : MakePlainImage<unsigned char>({ { 9, 9, 9 } }, 1));
  }
};

/** What an update may do without, or not. */
template <typename TFilter>
const Change<TFilter> ChangesOfMemory[] = {
  [](TFilter * filter) { const_cast<ImageType *>(filter->GetInput())->Initialize(); },
  [](TFilter * filter) { const_cast<ImageType *>(filter->GetInput())->SetRegions(itk::Size<3>{ { 9, 9, 9 } }); },
  [](TFilter * filter) { Shorten(const_cast<ImageType *>(filter->GetInput())); },
  [](TFilter * filter) { const_cast<ImageType *>(filter->GetInput())->SetSpacing(MakeVector3(1, 2, 3)); },
  [](TFilter * filter) {
    if (const auto * mask = filter->GetMaskImage())
    {
      const_cast<itk::Image<unsigned char, 3> *>(mask)->Initialize();
    }
  },
  [](TFilter * filter) {
    if (const auto * mask = filter->GetMaskImage())
    {
      Shorten(const_cast<itk::Image<unsigned char, 3> *>(mask));
    }
  },
  [](TFilter * filter) { filter->GetOutput()->Initialize(); },
  [](TFilter * filter) {
    if (filter->GetDepthOutput())
    {
      filter->GetDepthOutput()->Initialize();
    }
  }
};

enum class Outcome
{
  SameBits,
  ErrorAtTheStart, // and else the same bits
  Any
};

/** What an update gives: an exception's text, or the picture's size and pixels. */
struct Result
{
  std::string                     error;
  std::vector<itk::SizeValueType> size;
  std::vector<short>              pixels;

  bool
  operator==(const Result & other) const
  {
    return error.empty() == other.error.empty() && size == other.size && pixels == other.pixels;
  }
};

template <typename TFilter>
Result
Update(TFilter * filter)
{
  Result result;
  try
  {
    filter->UpdateLargestPossibleRegion();
    const auto & size = filter->GetOutput()->GetBufferedRegion().GetSize();
    result.size.assign(size.begin(), size.end());
    result.pixels = GetPixels(filter->GetOutput());
  }
  catch (const itk::ExceptionObject & error)
  {
    result.error = error.GetDescription();
  }
  return result;
}

/** Has an observer call \a change at the start of an update or at one of the events of its progress, and updates once
 * more. */
template <typename TFilter>
void
Disturb(void (*configure)(TFilter *), const Change<TFilter> & change, Outcome outcome)
{
  const auto undisturbed = TFilter::New();
  configure(undisturbed);
  const Result before = Update<TFilter>(undisturbed);
  change(undisturbed);
  const Result after = Update<TFilter>(undisturbed);
  for (const unsigned int threads : { 1, 2 })
  {
    for (const int at : { -1, 0, 1, 2, 4, 7 })
    {
      SCOPED_TRACE(std::to_string(threads) + " threads, event " + std::to_string(at));
      const auto filter = TFilter::New();
      configure(filter);
      filter->SetNumberOfWorkUnits(threads);
      int  events = 0;
      bool isChanged = false;
      auto disturb = [&](const itk::EventObject &) {
        if (events++ == std::max(at, 0) && !isChanged)
        {
          isChanged = true;
          change(filter);
        }
      };
      const auto observer =
        at < 0 ? filter->AddObserver(itk::StartEvent(), disturb) : filter->AddObserver(itk::ProgressEvent(), disturb);
      const Result disturbed = Update<TFilter>(filter);
      filter->RemoveObserver(observer);
      // the calling thread alone has events: with a second one, perhaps few
      EXPECT_TRUE(isChanged || threads > 1 || at > 2);
      const bool isError = !disturbed.error.empty();
      if (outcome == Outcome::ErrorAtTheStart && at < 0)
      {
        EXPECT_NE(disturbed.error.find("Inputs and outputs must not change during an update."), std::string::npos)
          << disturbed.error;
      }
      else if (outcome != Outcome::Any)
      {
        EXPECT_TRUE(disturbed == before) << disturbed.error;
      }
      else
      {
        // pixels that were written already may be gone
        EXPECT_TRUE(isError || disturbed.pixels == before.pixels || disturbed.pixels.empty() || at < 0);
      }
      if (isChanged && outcome != Outcome::Any)
      {
        const Result next = Update<TFilter>(filter);
        EXPECT_TRUE(next == after) << "the next update: " << next.error;
      }
    }
  }
}

template <typename TFilter, std::size_t VCount>
void
DisturbByEach(void (*configure)(TFilter *), const Change<TFilter> (&changes)[VCount], Outcome outcome)
{
  for (std::size_t n = 0; n < VCount; ++n)
  {
    SCOPED_TRACE("change " + std::to_string(n));
    Disturb(configure, changes[n], outcome);
  }
}

template <typename TFilter>
class ShearWarpObserved : public testing::Test
{};

using RayFilterTypes = testing::Types<SingleType, CineType>;
TYPED_TEST_SUITE(ShearWarpObserved, RayFilterTypes, );
} // namespace

TYPED_TEST(ShearWarpObserved, NoObserverBreaksAnUpdate)
{
  for (const auto configure : { &Configure<TypeParam>, &ConfigureRays<TypeParam>, &ConfigureStreamed<TypeParam> })
  {
    DisturbByEach(configure, HarmlessChanges<TypeParam>, Outcome::SameBits);
    DisturbByEach(configure, ChangesOfParameters<TypeParam>, Outcome::SameBits);
    DisturbByEach(configure, ChangesOfObjects<TypeParam>, Outcome::ErrorAtTheStart);
    DisturbByEach(configure, ChangesOfMemory<TypeParam>, Outcome::Any);
  }
  DisturbByEach(&ConfigureExact<TypeParam>, ChangesOfObjects<TypeParam>, Outcome::ErrorAtTheStart);
  DisturbByEach(&ConfigureExact<TypeParam>, ChangesOfMemory<TypeParam>, Outcome::Any);
}

TEST(ShearWarpObservedTurns, NoObserverBreaksAnUpdate)
{
  static ViewType::Pointer view;
  const auto               configureList = [](CineType * filter) {
    Configure(filter);
    view = MakeTestView();
    filter->AddTransform(view);
    filter->AddTransform(ViewType::New());
  };
  const Change<CineType> changes[] = { [](CineType * filter) { filter->SetNumberOfFrames(3); },
                                       [](CineType * filter) { filter->SetNumberOfFrames(100); },
                                       [](CineType * filter) { filter->SetRotationAxis(MakeVector3(1, 0, 0)); },
                                       [](CineType * filter) { filter->SetStartAngle(33); },
                                       [](CineType * filter) { filter->SetAngularRange(100); },
                                       [](CineType * filter) { filter->SetCenter(MakePoint3(99, 0, 0)); },
                                       [](CineType * filter) { filter->RockingOn(); },
                                       [](CineType * filter) { filter->AddTransform(ViewType::New()); } };
  DisturbByEach<CineType>(&Configure<CineType>, changes, Outcome::SameBits);
  const Change<CineType> changesOfList[] = { [](CineType * filter) { filter->ClearTransforms(); },
                                             [](CineType * filter) {
                                               filter->ClearTransforms();
                                               filter->AddTransform(ViewType::New());
                                               filter->AddTransform(ViewType::New());
                                             },
                                             [](CineType *) { view->SetMatrix(MakeDiagonal(1, 2, 3)); } };
  DisturbByEach<CineType>(configureList, changesOfList, Outcome::SameBits);
}

namespace
{
PartsType::PartImageType::Pointer
CopyPart(const PartsType::PartImageType * part)
{
  const auto copy = MakeAlike<unsigned char, 3>(part, part->GetBufferedRegion());
  itk::ImageAlgorithm::Copy(part, copy.GetPointer(), part->GetBufferedRegion(), part->GetBufferedRegion());
  return copy;
}
} // namespace

TEST(ShearWarpObservedParts, NoObserverBreaksPartsAndTheirPicture)
{
  static PartsType::PartImageType::Pointer part;
  const auto                               configure = [](PartsType * filter) {
    Configure(filter);
    part = filter->ProjectPart(filter->GetInput());
    filter->AddPart(part);
    filter->ReleasePreparedVolume();
  };
  DisturbByEach<PartsType>(configure, HarmlessChanges<PartsType>, Outcome::SameBits);
  DisturbByEach<PartsType>(configure, ChangesOfParameters<PartsType>, Outcome::SameBits);
  const Change<PartsType> changes[] = { [](PartsType * filter) { filter->ClearParts(); },
                                        [](PartsType * filter) { filter->AddPart(CopyPart(part)); },
                                        [](PartsType *) { part->Initialize(); },
                                        [](PartsType *) { Shorten(part.GetPointer()); } };
  DisturbByEach<PartsType>(configure, changes, Outcome::Any);
  DisturbByEach<PartsType>(configure, ChangesOfMemory<PartsType>, Outcome::Any);

  // while a part is projected
  const auto image = MakeTestImage();
  const auto project = [&](PartsType * filter) { return GetPixels(filter->ProjectPart(image)); };
  for (const auto & change : ChangesOfParameters<PartsType>)
  {
    for (const unsigned int threads : { 1, 2 })
    {
      const auto filter = MakeConfigured<PartsType>();
      filter->SetNumberOfWorkUnits(threads);
      const auto before = project(filter);
      filter->ReleasePreparedVolume();
      int        events = 0;
      const auto observer = filter->AddObserver(itk::ProgressEvent(), [&](const itk::EventObject &) {
        if (events++ == 3)
        {
          GetExceptionDescription([&] { change(filter); });
        }
      });
      EXPECT_EQ(project(filter), before);
      filter->RemoveObserver(observer);
    }
  }
}

namespace
{
template <typename TFilter>
class ShearWarpInputs : public testing::Test
{};

using FilterTypes = testing::Types<SingleType, CineType, PartsType>;
TYPED_TEST_SUITE(ShearWarpInputs, FilterTypes, );

template <typename TFilter>
class ShearWarpVoxels : public testing::Test
{};
TYPED_TEST_SUITE(ShearWarpVoxels, RayFilterTypes, );
} // namespace

TYPED_TEST(ShearWarpVoxels, FewerThanTheirRegionAreAnError)
{
  const auto filter = MakeConfigured<TypeParam>();
  const auto image = MakeTestImage();
  Shorten(image.GetPointer());
  filter->SetInput(image);
  EXPECT_NAMES(filter->Update(), "The input must be buffered where it is requested, but there are 85183 voxels");
  ConfigureRays(filter.GetPointer());
  const auto mask = MakePlainImage<unsigned char>({ { 44, 44, 44 } }, 1);
  Shorten(mask.GetPointer());
  filter->SetMaskImage(mask);
  EXPECT_NAMES(filter->Update(), "The MaskImage must be buffered where it is requested, but there are 85183 voxels");
}

TYPED_TEST(ShearWarpVoxels, NoneAreAnErrorAlongEachAxis)
{
  for (const unsigned int axis : { 0, 1, 2 })
  {
    const auto filter = MakeConfigured<TypeParam>();
    filter->SetInput(MakeOutline(filter->GetInput()));
    filter->SetTransform(MakeView(MakeAxisMatrix(axis), PointType(0.0)));
    for (const auto reducedResampling :
         { TypeParam::ReducedResamplingEnum::Off, TypeParam::ReducedResamplingEnum::Auto })
    {
      filter->SetReducedResampling(reducedResampling);
      EXPECT_NAMES(filter->Update(), "The input must be buffered where it is requested, but there are 0 voxels");
    }
    filter->LocalMaximumOn();
    EXPECT_NAMES(filter->Update(), "The input must be buffered where it is requested, but there are 0 voxels");
  }
}

TYPED_TEST(ShearWarpVoxels, MeasurementsOutliveWhatIsReleased)
{
  const auto          filter = MakeConfigured<TypeParam>();
  const std::string & name = filter->GetInstructionSet();
  EXPECT_EQ(name, "portable");
  filter->Update();
  const std::string before = name;
  filter->ReleasePreparedVolume();
  EXPECT_EQ(name, before);
  EXPECT_EQ(filter->GetInstructionSet(), itk::ShearWarp::GetInstructionSets().back());
  EXPECT_EQ(filter->GetPrincipalAxis(), 0u);
}

namespace
{
/** \class OpenFilter
 * Lets any data object be any input. */
template <typename TFilter>
class OpenFilter : public TFilter
{
public:
  using Self = OpenFilter;
  using Pointer = itk::SmartPointer<Self>;
  itkNewMacro(Self);

  void
  SetAnyInput(const std::string & name, itk::DataObject * object)
  {
    this->ProcessObject::SetInput(name, object);
  }
};
} // namespace

TYPED_TEST(ShearWarpInputs, OfAnotherTypeAreErrorsThatSayWhatTheyAreFor)
{
  const auto expect = [&](const std::string & name, const std::string & purpose) {
    const auto filter = OpenFilter<TypeParam>::New();
    Configure<TypeParam>(filter);
    filter->SetAnyInput(name, itk::Image<double, 2>::New());
    EXPECT_NAMES(filter->Update(), "Input " + name + " is for " + purpose + ", not for an object of class Image (");
  };
  expect("Primary", "the 3D image that is projected");
  expect("Transform", "the view, a decorated transform");
  expect("MaskImage", "the mask, a 3D image of unsigned char");
}

TYPED_TEST(ShearWarpInputs, OfOtherNumbersAreErrors)
{
  const auto filter = MakeConfigured<TypeParam>();
  filter->SetInput(1, MakeTestImage(20));
  EXPECT_NAMES(filter->Update(), "Input 1 is not used: only input 0, the 3D image that is projected, is numbered.");
}

TYPED_TEST(ShearWarpVoxels, AllThatIsHeldIsCountedAndFreed)
{
  using ConfigureFunction = void (*)(TypeParam *);
  for (const ConfigureFunction configure : { &Configure<TypeParam>, &ConfigureRays<TypeParam> })
  {
    const auto filter = TypeParam::New();
    EXPECT_EQ(filter->GetPreparedVolumeSizeInBytes(), 0u);
    configure(filter);
    // the second view along x
    filter->Update();
    UpdateAnew(filter);
    const auto         expected = GetPixels(filter->GetOutput());
    const itk::Size<2> size =
      itk::ShearWarpFactorization(filter->GetTransform(), filter->GetInput(), itk::ImageBase<2>::New())
        .GetIntermediateSize();
    EXPECT_GE(filter->GetPreparedVolumeSizeInBytes(),
              sizeof(short) * (std::size_t{ 44 } * 44 * 44 + size[0] * size[1]));
    const auto counted = static_cast<double>(filter->GetPreparedVolumeSizeInBytes());
    const auto allocated = CountAllocatedBytes();
    filter->ReleasePreparedVolume();
    if (allocated > 0)
    {
      EXPECT_NEAR(static_cast<double>(allocated - CountAllocatedBytes()), counted, 0.03 * counted);
    }
    EXPECT_EQ(filter->GetPreparedVolumeSizeInBytes(), 0u);
    UpdateAnew(filter);
    EXPECT_EQ(GetPixels(filter->GetOutput()), expected);
  }
}

TEST(ShearWarpMemoryOfASeries, DoesNotGrowWithItsFrames)
{
  // many slices, which factorizations place one by one, almost along the view
  const auto image = MakePlainImage<short>({ { 2, 2, 1000 } });
  const auto measure = [&](unsigned int frames, bool isPlain) {
    const auto filter = CineType::New();
    filter->SetInput(image);
    filter->SetNumberOfFrames(frames);
    filter->SetTransform(ViewType::New());
    filter->SetRotationAxis(MakeVector3(1, 0, 0));
    filter->SetAngularRange(1.0);
    filter->SetSize({ { 1, 1 } });
    filter->SetNumberOfWorkUnits(1);
    filter->SetMode(isPlain ? itk::ShearWarpMIPImageFilterEnums::Mode::Maximum
                            : itk::ShearWarpMIPImageFilterEnums::Mode::Minimum);
    std::size_t       most = 0;
    const std::size_t before = CountAllocatedBytes();
    filter->AddObserver(itk::ProgressEvent(),
                        [&](const itk::EventObject &) { most = std::max(most, CountAllocatedBytes() - before); });
    filter->Update();
    return std::max<std::size_t>(most, filter->GetPreparedVolumeSizeInBytes());
  };
  for (const bool isPlain : { true, false })
  {
    // 1 KiB for each frame: its numbers, and its matrix in the dictionary
    EXPECT_LT(measure(1024, isPlain), measure(512, isPlain) + (512 << 10));
  }
}

TEST(ShearWarpMemoryOfASeries, IsSharedByFramesFromOppositeSides)
{
  const auto image = MakeTestImage();
  const auto measure = [&](unsigned int frames, double range) {
    const auto filter = CineType::New();
    filter->SetInput(image);
    filter->SetNumberOfFrames(frames);
    filter->SetAngularRange(range);
    filter->SetNumberOfWorkUnits(1);
    filter->Update();
    return filter->GetPreparedVolumeSizeInBytes();
  };
  EXPECT_EQ(measure(72, 360.0), measure(36, 180.0));
  EXPECT_LT(measure(36, 180.0), measure(72, 180.0));
}

TEST(ShearWarpObserved, AFilterThatProjectsRefusesToProjectAPart)
{
  const auto image = MakeTestImage();
  const auto parts = PartsType::New();
  Configure<PartsType>(parts);
  parts->AddPart(parts->ProjectPart(image));
  parts->Update();
  const auto expected = Copy(parts->GetOutput());
  int        refusals = 0;
  parts->AddObserver(itk::ProgressEvent(), [&](const itk::EventObject &) {
    const auto text = GetExceptionDescription([&] { parts->ProjectPart(image); });
    refusals += text.find("The filter projects already, for an observer") != std::string::npos;
    parts->ReleasePreparedVolume();
  });
  UpdateAnew(parts);
  EXPECT_GT(refusals, 0);
  EXPECT_TRUE(HaveSamePixels(expected, parts->GetOutput()));
}

TEST(ShearWarpObserved, ExactPicturesReportProgressAsTheySearch)
{
  const auto filter = MakeConfigured<SingleType>();
  filter->SetNumberOfWorkUnits(1);
  filter->ExactOn();
  std::vector<float> seen{ 0.0f };
  filter->AddObserver(itk::ProgressEvent(), [&](const itk::EventObject &) { seen.push_back(filter->GetProgress()); });
  filter->Update();
  EXPECT_GT(seen.size(), 5u);
  for (std::size_t n = 1; n < seen.size(); ++n)
  {
    EXPECT_GE(seen[n], seen[n - 1]);
    EXPECT_LT(seen[n] - seen[n - 1], 0.35f);
  }
}

TEST(ShearWarpObserved, AnotherInputOfTheSameSizeAtTheStartIsAnError)
{
  const auto filter = MakeConfigured<SingleType>();
  const auto other = MakeTestImage();
  other->SetSpacing(MakeVector3(1, 2, 3));
  const auto observer =
    filter->AddObserver(itk::StartEvent(), [&](const itk::EventObject &) { filter->SetInput(other); });
  EXPECT_NE(GetExceptionDescription([&] { filter->Update(); }).find("must not change during an update"),
            std::string::npos);
  filter->RemoveObserver(observer);
  filter->Update();
  const auto fresh = MakeConfigured<SingleType>();
  fresh->SetInput(other);
  fresh->Update();
  EXPECT_TRUE(HaveSamePixels(fresh->GetOutput(), filter->GetOutput()));
}

TEST(ShearWarpObserved, AnOutputThatIsTakenDuringItsWarpIsAnError)
{
  const auto filter = MakeConfigured<SingleType>();
  filter->SetNumberOfWorkUnits(1);
  // a large picture of few voxels: most of the time goes into the warp
  filter->SetSize({ { 400, 400 } });
  const auto observer = filter->AddObserver(itk::ProgressEvent(), [&](const itk::EventObject &) {
    if (filter->GetProgress() > 0.9f && filter->GetProgress() < 1.0f)
    {
      filter->GetOutput()->Initialize();
    }
  });
  EXPECT_NE(GetExceptionDescription([&] { filter->Update(); }).find("must not change during an update"),
            std::string::npos);
  filter->RemoveObserver(observer);
  filter->Update();
  EXPECT_EQ(filter->GetOutput()->GetPixelContainer()->Size(), 400u * 400u);
}

TEST(ShearWarpObserved, VoxelsThatChangeDuringAnUpdateAreProjectedByTheNextOne)
{
  const auto image = MakeTestImage();
  const auto filter = MakeConfigured<SingleType>();
  // the observer writes what other threads would read
  filter->SetNumberOfWorkUnits(1);
  filter->SetInput(image);
  // the second view keeps a copy
  filter->Update();
  filter->Modified();
  short      value = 0;
  const auto observer = filter->AddObserver(itk::ProgressEvent(), [&](const itk::EventObject &) {
    image->FillBuffer(++value);
    image->Modified();
  });
  filter->Update();
  filter->RemoveObserver(observer);
  filter->Update();
  const auto fresh = MakeConfigured<SingleType>();
  fresh->SetInput(image);
  fresh->Update();
  EXPECT_TRUE(HaveSamePixels(fresh->GetOutput(), filter->GetOutput()));
}

TEST(ShearWarpObserved, WhatAnObserverOfTheStartThrowsLeavesTheFilterRight)
{
  const auto filter = MakeConfigured<SingleType>();
  const auto observer =
    filter->AddObserver(itk::StartEvent(), [](const itk::EventObject &) { throw std::runtime_error("stopped"); });
  EXPECT_THROW(filter->Update(), std::runtime_error);
  filter->RemoveObserver(observer);
  filter->Update();
  const auto fresh = MakeConfigured<SingleType>();
  fresh->Update();
  EXPECT_TRUE(HaveSamePixels(fresh->GetOutput(), filter->GetOutput()));
}

TEST(ShearWarpInputsOfParts, OfAnotherGeometryAreErrors)
{
  const auto parts = MakeConfigured<PartsType>();
  const auto image = MakeTestImage();
  image->SetSpacing(MakeVector3(1, 2, 3));
  EXPECT_NE(GetExceptionDescription([&] { parts->ProjectPart(image); }).find("must have the input's spacing"),
            std::string::npos);
}
