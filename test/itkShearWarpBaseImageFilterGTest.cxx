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
#include "itkShearWarpMIPPartImageFilter.h"

#include "itkShearWarpMIPTestParts.h"


#include <functional>

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
using PartType = itk::ShearWarpMIPPartImageFilter<ImageType>;
using MergeType = itk::ShearWarpMIPMergePartsImageFilter<ImageType>;

ImageType::Pointer
MakeTestImage(itk::SizeValueType length = 44)
{
  Random     random(1201);
  const auto image = MakePlainImage<short>({ { length, length, length } });
  FillRandom(random, image.GetPointer());
  return image;
}

/** Along x and, for one that is turned, along y. */
ViewType::Pointer
MakeTestView()
{
  return MakeView(MakeMatrix({ { 0.1, 0.2, 1 }, { 1, 0, 0.3 }, { 0, 1, 0.2 } }), PointType(0.0));
}

/** Of the process; 0 where the C library does not tell. */
std::size_t
CountAllocatedBytes()
{
#ifdef HAS_MALLINFO2
  return mallinfo2().uordblks + mallinfo2().hblkhd;
#else
  return 0;
#endif
}

/** Takes one pixel from what is held. */
template <typename TPixel, unsigned int VDimension>
void
Shorten(itk::Image<TPixel, VDimension> * image)
{
  const auto pixels = itk::Image<TPixel, VDimension>::PixelContainer::New();
  pixels->Reserve(image->GetBufferedRegion().GetNumberOfPixels() - 1);
  std::fill_n(pixels->GetBufferPointer(), pixels->Size(), TPixel{ 1 });
  image->SetPixelContainer(pixels);
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

/** What changes the next update alone, if anything. */
template <typename TFilter>
const Change<TFilter> HarmlessChanges[] = {
  [](TFilter * filter) { filter->SetNumberOfWorkUnits(8); },
  [](TFilter * filter) { filter->SetNumberOfWorkUnits(1); },
  [](TFilter * filter) { filter->GetMultiThreader()->SetNumberOfWorkUnits(8); },
  [](TFilter * filter) { filter->GetMultiThreader()->SetMaximumNumberOfThreads(1); },
  [](TFilter * filter) { filter->SetMultiThreader(itk::MultiThreaderBase::New()); },
  [](TFilter * filter) { filter->ReleasePreparedVolume(); },
  [](TFilter * filter) { filter->UpdateOutputInformation(); },
  [](TFilter * filter) { filter->Update(); }
};

/** What an update depends on. */
template <typename TFilter>
const Change<TFilter> HarmfulChanges[] = {
  [](TFilter * filter) { filter->SetInput(MakeTestImage(20)); },
  [](TFilter * filter) { filter->SetInput(nullptr); },
  [](TFilter * filter) { filter->SetTransform(ViewType::New()); },
  [](TFilter * filter) {
    const_cast<ViewType *>(dynamic_cast<const ViewType *>(filter->GetTransform()))->SetMatrix(MakeDiagonal(1, 2, 3));
  },
  [](TFilter * filter) {
    const auto        spacing = MakeVector3(1, 2, 3);
    const_cast<ImageType *>(filter->GetInput())->SetSpacing(spacing);
  },
  [](TFilter * filter) { filter->SetOversampling(2); }
};

template <typename TFilter>
const Change<TFilter> HarmfulChangesOfRays[] = {
  [](TFilter * filter) { filter->SetComputeDepth(!filter->GetComputeDepth()); },
  [](TFilter * filter) {
    filter->SetMaskImage(filter->GetMaskImage() ? nullptr : MakePlainImage<unsigned char>({ { 9, 9, 9 } }, 1));
  },
  [](TFilter * filter) { filter->SetNumberOfStreamDivisions(5); },
  [](TFilter * filter) { filter->SetMode(itk::ShearWarpMIPImageFilterEnums::Mode::Minimum); },
  [](TFilter * filter) { filter->SetSlabFar(1.0); },
  [](TFilter * filter) { filter->SetCropLower(MakePoint3(1, 2, 3)); },
  [](TFilter * filter) { filter->SetIntermediateMemory(1); },
  [](TFilter * filter) { filter->SetDefaultPixelValue(7); },
  [](TFilter * filter) { filter->SetSize({ { 200, 200 } }); }
};

/** The data objects may do without until the end, or not. */
template <typename TFilter>
const Change<TFilter> ChangesOfData[] = {
  [](TFilter * filter) { const_cast<ImageType *>(filter->GetInput())->Initialize(); },
  [](TFilter * filter) { const_cast<ImageType *>(filter->GetInput())->SetRegions(itk::Size<3>{ { 9, 9, 9 } }); },
  [](TFilter * filter) { Shorten(const_cast<ImageType *>(filter->GetInput())); },
  [](TFilter * filter) { filter->GetOutput()->Initialize(); }
};

enum class Outcome
{
  SameBits,
  Error,
  Any
};

/** Has an observer call \a change at the start of an update or at one of the events of its progress. */
template <typename TFilter>
void
Disturb(void (*configure)(TFilter *), const Change<TFilter> & change, Outcome outcome)
{
  const auto undisturbed = TFilter::New();
  configure(undisturbed);
  undisturbed->Update();
  const auto expected = GetPixels(undisturbed->GetOutput());
  for (const unsigned int threads : { 1, 2 })
  {
    for (const int at : { -1, 0, 1, 2, 4, 7 })
    {
      SCOPED_TRACE(std::to_string(threads) + " threads, event " + std::to_string(at));
      const auto filter = TFilter::New();
      configure(filter);
      filter->SetNumberOfWorkUnits(threads);
      int  events = 0;
      auto disturb = [&](const itk::EventObject &) {
        if (events++ == std::max(at, 0))
        {
          change(filter);
        }
      };
      at < 0 ? filter->AddObserver(itk::StartEvent(), disturb) : filter->AddObserver(itk::ProgressEvent(), disturb);
      try
      {
        filter->Update();
        // the calling thread alone has events: with a second one, perhaps the last event only
        EXPECT_TRUE(outcome != Outcome::Error || (at != -1 && (at != 0 || threads > 1))) << "no exception";
        EXPECT_TRUE(outcome != Outcome::SameBits || GetPixels(filter->GetOutput()) == expected);
      }
      catch (const itk::ExceptionObject & error)
      {
        const std::string text = error.GetDescription();
        EXPECT_NE(outcome, Outcome::SameBits) << text;
        EXPECT_TRUE(outcome == Outcome::Any || at < 0 ||
                    text.find("Parameters, inputs and outputs must not change during an update") != std::string::npos)
          << text;
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
class ShearWarpObservedRays : public testing::Test
{};

using RayFilterTypes = testing::Types<SingleType, CineType>;
TYPED_TEST_SUITE(ShearWarpObservedRays, RayFilterTypes, );
} // namespace

TYPED_TEST(ShearWarpObservedRays, NoObserverBreaksAnUpdate)
{
  for (const auto configure : { &Configure<TypeParam>, &ConfigureRays<TypeParam> })
  {
    DisturbByEach(configure, HarmlessChanges<TypeParam>, Outcome::SameBits);
    DisturbByEach(configure, HarmfulChanges<TypeParam>, Outcome::Error);
    DisturbByEach(configure, HarmfulChangesOfRays<TypeParam>, Outcome::Error);
    DisturbByEach(configure, ChangesOfData<TypeParam>, Outcome::Any);
  }
}

TEST(ShearWarpObserved, NoObserverBreaksATurn)
{
  const auto               configure = &Configure<CineType>;
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
                                       [](CineType * filter) { filter->AddTransform(ViewType::New()); } };
  DisturbByEach<CineType>(configure, changes, Outcome::Error);
  const Change<CineType> changesOfList[] = { [](CineType * filter) { filter->ClearTransforms(); },
                                             [](CineType * filter) {
                                               filter->ClearTransforms();
                                               filter->AddTransform(ViewType::New());
                                               filter->AddTransform(ViewType::New());
                                             },
                                             [](CineType *) { view->SetMatrix(MakeDiagonal(1, 2, 3)); } };
  DisturbByEach<CineType>(configureList, changesOfList, Outcome::Error);
}

TEST(ShearWarpObserved, NoObserverBreaksPartsAndTheirPicture)
{
  DisturbByEach(&Configure<PartType>, HarmlessChanges<PartType>, Outcome::SameBits);
  DisturbByEach(&Configure<PartType>, HarmfulChanges<PartType>, Outcome::Error);
  DisturbByEach(&Configure<PartType>, ChangesOfData<PartType>, Outcome::Any);
  const Change<PartType> otherWhole = [](PartType * filter) {
    filter->SetWholeRegion(itk::ImageRegion<3>({ { -5, -5, -5 } }, { { 60, 60, 60 } }));
  };
  Disturb(&Configure<PartType>, otherWhole, Outcome::Error);

  const auto configureParts = [](MergeType * filter) {
    Configure(filter);
    const auto part = MakeConfigured<PartType>();
    part->Update();
    for (const unsigned int n : { 0, 1 })
    {
      const auto copy = Copy(part->GetOutput());
      filter->SetPart(n, copy);
    }
  };
  const Change<MergeType> changes[] = { [](MergeType * filter) { filter->ClearParts(); },
                                        [](MergeType * filter) { filter->SetPart(1, nullptr); },
                                        [](MergeType * filter) {
                                          const_cast<itk::Image<short, 2> *>(filter->GetPart(1))->Initialize();
                                        } };
  DisturbByEach<MergeType>(configureParts, changes, Outcome::Any);
}

namespace
{
template <typename TFilter>
class ShearWarpInputs : public testing::Test
{};

using FilterTypes = testing::Types<SingleType, CineType, PartType>;
TYPED_TEST_SUITE(ShearWarpInputs, FilterTypes, );
} // namespace

TYPED_TEST(ShearWarpInputs, FewerVoxelsThanTheirRegionAreAnError)
{
  const auto filter = MakeConfigured<TypeParam>();
  const auto image = MakeTestImage();
  Shorten(image.GetPointer());
  filter->SetInput(image);
  EXPECT_NAMES(filter->Update(), "The input must be buffered where it is requested, but there are 85183 voxels");
  if constexpr (!std::is_same_v<TypeParam, PartType>)
  {
    ConfigureRays(filter.GetPointer());
    const auto mask = MakePlainImage<unsigned char>({ { 44, 44, 44 } }, 1);
    Shorten(mask.GetPointer());
    filter->SetMaskImage(mask);
    EXPECT_NAMES(filter->Update(), "The MaskImage must be buffered where it is requested, but there are 85183 voxels");
  }
}

TYPED_TEST(ShearWarpInputs, NoVoxelsAreAnErrorAlongEachAxis)
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
    if constexpr (!std::is_same_v<TypeParam, PartType>)
    {
      filter->LocalMaximumOn();
      EXPECT_NAMES(filter->Update(), "The input must be buffered where it is requested, but there are 0 voxels");
    }
  }
}

TYPED_TEST(ShearWarpInputs, MeasurementsOutliveWhatIsReleased)
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

TEST(ShearWarpInputsOfParts, FewerPixelsThanTheirRegionAreAnError)
{
  const auto source = MakeConfigured<PartType>();
  source->Update();
  const auto filter = MakeConfigured<MergeType>();
  const auto part = Copy(source->GetOutput());
  filter->SetPart(0, Copy(part.GetPointer()));
  Shorten(part.GetPointer());
  filter->SetPart(1, part);
  EXPECT_NAMES(filter->Update(), "The part 1 must be buffered where it is requested, but there are ");
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
  if constexpr (!std::is_same_v<TypeParam, PartType>)
  {
    expect("MaskImage", "the mask, a 3D image of unsigned char");
  }
}

TEST(ShearWarpInputsOfParts, OfAnotherTypeAreErrorsThatSayWhatTheyAreFor)
{
  const auto filter = MakeConfigured<MergeType>();
  filter->SetInput(1, MakeTestImage());
  EXPECT_EQ(filter->GetPart(0), nullptr);
  EXPECT_NAMES(filter->Update(),
               "Input _1 is for part 0, a 2D image of ShearWarpMIPPartImageFilter, not for an object of class Image (");
}

TEST(ShearWarpInputsOfParts, OfOtherFiltersAreErrors)
{
  const auto expect = [](const auto & filter, unsigned int input, const std::string & text) {
    SCOPED_TRACE(filter->GetNameOfClass());
    filter->SetInput(input, MakeTestImage(20));
    EXPECT_NAMES(filter->Update(), text);
  };
  expect(MakeConfigured<SingleType>(), 1, "Input 1 is for nothing: input 0 is the 3D image that is projected");
  expect(MakeConfigured<CineType>(), 1, "Input 1 is for nothing: input 0 is the 3D image that is projected");
  expect(MakeConfigured<PartType>(), 2, "Input 2 is for nothing");
}

TYPED_TEST(ShearWarpInputs, AllThatIsHeldIsCountedAndFreed)
{
  using ConfigureFunction = void (*)(TypeParam *);
  std::vector<ConfigureFunction> configures{ &Configure<TypeParam> };
  if constexpr (!std::is_same_v<TypeParam, PartType>)
  {
    configures.push_back(&ConfigureRays<TypeParam>);
  }
  for (const ConfigureFunction configure : configures)
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
