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
#include "itkShearWarpMIPImageFilter.h"

#include "itkShearWarpMIPCineImageFilter.h"
#include "itkShearWarpMIPTestOracle.h"
#include "itkShearWarpMIPTestParts.h"

#include "itkBSplineTransform.h"
#include "itkCastImageFilter.h"
#include "itkCompositeTransform.h"
#include "itkEuler3DTransform.h"
#include "itkImageAlgorithm.h"
#include "itkStreamingImageFilter.h"

#include "itksys/SystemTools.hxx"

#include <atomic>
#include <chrono>
#include <new>
#include <set>
#include <sstream>
#include <stdexcept>
#include <thread>

namespace
{
/** How many more allocations of a ShearWarpBuffer succeed; all, if negative. */
std::atomic<int> allocationsUntilFailure{ -1 };
} // namespace

/** Replaces the standard one, which only ShearWarpBuffer calls. */
void *
operator new(std::size_t size, std::align_val_t alignment, const std::nothrow_t &) noexcept
{
  if (allocationsUntilFailure >= 0 && allocationsUntilFailure-- == 0)
  {
    return nullptr;
  }
  try
  {
    return ::operator new(size, alignment);
  }
  catch (const std::bad_alloc &)
  {
    return nullptr;
  }
}

namespace
{
using namespace itk::ShearWarpMIPTest;

using ImageType = itk::Image<short, 3>;
using OutputType = itk::Image<short, 2>;
using FilterType = itk::ShearWarpMIPImageFilter<ImageType>;

/** \class ExecutionCounter
 * Counts how often a process object executes. */
class ExecutionCounter
{
public:
  explicit ExecutionCounter(itk::ProcessObject * process)
  {
    process->AddObserver(itk::StartEvent(), [this](const itk::EventObject &) { ++m_Count; });
  }
  ITK_DISALLOW_COPY_AND_MOVE(ExecutionCounter);

  int
  GetCount() const
  {
    return m_Count;
  }

private:
  int m_Count{ 0 };
};

/** \class TransformSource
 * Makes a view by an angle, as a registration does by images. */
class TransformSource : public itk::ProcessObject
{
public:
  using Self = TransformSource;
  using Pointer = itk::SmartPointer<Self>;
  using DecoratorType = itk::DataObjectDecorator<itk::Transform<double, 3, 3>>;
  itkNewMacro(Self);

  itkSetMacro(Angle, double);
  itkSetMacro(IsInPlace, bool);

  DecoratorType *
  GetOutput()
  {
    return static_cast<DecoratorType *>(this->ProcessObject::GetOutput(0));
  }

  /** Null for an angle that is not a number. */
  static ViewType::Pointer
  MakeTransform(double angle)
  {
    const auto view = std::isnan(angle) ? nullptr : ViewType::New();
    if (view)
    {
      view->Rotate3D(MakeVector3(1, 2, 3), angle);
    }
    return view;
  }

protected:
  TransformSource() { this->SetNthOutput(0, DecoratorType::New()); }

  void
  GenerateData() override
  {
    const auto view = MakeTransform(m_Angle);
    if (m_IsInPlace && m_View && view)
    {
      m_View->SetMatrix(view->GetMatrix());
    }
    else
    {
      m_View = view;
    }
    this->GetOutput()->Set(m_View);
  }

private:
  double            m_Angle{ 0.0 };
  bool              m_IsInPlace{ false };
  ViewType::Pointer m_View;
};

/** \class ImageAndTransformSource
 * Makes an image and its view in one run, as a reader may. */
class ImageAndTransformSource : public itk::ImageSource<ImageType>
{
public:
  using Self = ImageAndTransformSource;
  using Pointer = itk::SmartPointer<Self>;
  using DecoratorType = TransformSource::DecoratorType;
  itkNewMacro(Self);

  itkSetMacro(Angle, double);
  itkSetConstObjectMacro(Image, ImageType);

  DecoratorType *
  GetTransformOutput()
  {
    return static_cast<DecoratorType *>(this->ProcessObject::GetOutput(1));
  }

protected:
  ImageAndTransformSource() { this->SetNthOutput(1, DecoratorType::New()); }

  void
  GenerateOutputInformation() override
  {
    this->GetOutput()->CopyInformation(m_Image);
  }

  void
  GenerateData() override
  {
    auto * output = this->GetOutput();
    output->SetBufferedRegion(output->GetRequestedRegion());
    output->Allocate();
    itk::ImageAlgorithm::Copy(m_Image.GetPointer(), output, output->GetBufferedRegion(), output->GetBufferedRegion());
    this->GetTransformOutput()->Set(TransformSource::MakeTransform(m_Angle));
  }

private:
  double                  m_Angle{ 0.0 };
  ImageType::ConstPointer m_Image;
};

/** Expects that a filter whose view has a source gives the output of \a makeFilter()'s filter, whose view has none. */
template <typename TMakeFilter>
void
ExpectFollowsTheSourceOfItsTransform(const TMakeFilter & makeFilter)
{
  const auto source = TransformSource::New();
  const auto filter = makeFilter();
  filter->SetTransformInput(source->GetOutput());
  const ExecutionCounter executions(filter);
  const ExecutionCounter executionsOfSource(source);
  int                    count = 0;
  for (const double angle : { 0.4, -1.3, 2.2, 0.1 })
  {
    SCOPED_TRACE(angle);
    source->SetAngle(angle);
    source->SetIsInPlace(count > 1);
    const auto expected = makeFilter();
    expected->SetTransform(TransformSource::MakeTransform(angle));
    expected->Update();
    filter->UpdateOutputInformation();
    EXPECT_EQ(filter->GetOutput()->GetLargestPossibleRegion(), expected->GetOutput()->GetLargestPossibleRegion());
    filter->UpdateLargestPossibleRegion();
    EXPECT_TRUE(HaveSamePixels(filter->GetOutput(), expected->GetOutput()));
    EXPECT_EQ(filter->GetOutput()->GetOrigin(), expected->GetOutput()->GetOrigin());
    EXPECT_EQ(filter->GetOutput()->GetSpacing(), expected->GetOutput()->GetSpacing());
    EXPECT_EQ(filter->GetOutput()->GetDirection(), expected->GetOutput()->GetDirection());
    filter->Update();
    ++count;
    EXPECT_EQ(executions.GetCount(), count);
    EXPECT_EQ(executionsOfSource.GetCount(), count);
  }
  source->SetAngle(std::numeric_limits<double>::quiet_NaN());
  EXPECT_NAMES(filter->Update(), "Transform", "not set");
  // what the source lost is made again
  source->SetAngle(0.4);
  source->ReleaseDataFlagOn();
  for (int repeat = 0; repeat < 2; ++repeat)
  {
    const auto expected = makeFilter();
    expected->SetTransform(TransformSource::MakeTransform(0.4));
    expected->Update();
    filter->UpdateLargestPossibleRegion();
    EXPECT_TRUE(HaveSamePixels(filter->GetOutput(), expected->GetOutput()));
  }
}

/** \class ProgressRecorder
 * Aborts when the progress reaches a limit, and keeps what was reported. */
class ProgressRecorder
{
public:
  explicit ProgressRecorder(itk::ProcessObject * process)
  {
    process->AddObserver(itk::ProgressEvent(), [this, process](const itk::EventObject &) {
      progress.push_back(process->GetProgress());
      if (progress.back() >= abortAt)
      {
        process->AbortGenerateDataOn();
      }
    });
  }
  ITK_DISALLOW_COPY_AND_MOVE(ProgressRecorder);

  std::vector<float> progress;
  float              abortAt{ 2.0f };
};

/** \class ScantImageSource
 * A source that gives less than it was asked for. */
class ScantImageSource : public itk::ImageSource<ImageType>
{
public:
  using Self = ScantImageSource;
  using Pointer = itk::SmartPointer<Self>;
  itkNewMacro(Self);

protected:
  void
  GenerateOutputInformation() override
  {
    this->GetOutput()->SetLargestPossibleRegion(itk::Size<3>{ { 40, 41, 42 } });
  }

  void
  GenerateData() override
  {
    this->GetOutput()->SetBufferedRegion(itk::ImageRegion<3>({ { 0, 0, 21 } }, { { 40, 41, 21 } }));
    this->GetOutput()->Allocate(true);
  }
};

/** Looks along index axis \a axis of an image of identity direction, a little from the side. */
ViewType::Pointer
MakeViewAlong(unsigned int axis)
{
  auto euler = itk::Euler3DTransform<double>::New();
  euler->SetRotation(0.1, 0.2, 0.3);
  MatrixType permutation;
  permutation(axis, 2) = 1.0;
  permutation((axis + 1) % 3, 0) = 1.0;
  permutation((axis + 2) % 3, 1) = 1.0;
  return MakeView(euler->GetMatrix() * permutation, MakePoint3(5, 5, 5));
}

ImageType::Pointer
MakeTestImage(std::uint64_t seed, const itk::Size<3> & size = { { 40, 41, 42 } })
{
  Random     random(seed);
  const auto image = MakePlainImage<short>(size);
  FillRandom(random, image.GetPointer());
  return image;
}

/** What a filter that was never used before gives. */
OutputType::Pointer
ProjectAfresh(const ImageType * image, const itk::Transform<double, 3, 3> * view)
{
  const auto filter = MakeFilter(image, view);
  filter->Update();
  return Copy(filter->GetOutput());
}

class ShearWarpMIPPipeline : public testing::Test
{
protected:
  void
  SetUp() override
  {
    m_Image = MakeTestImage(501);
    m_Filter = MakeFilter(m_Image, MakeViewAlong(0));
  }

  void
  ExpectWorksAgain()
  {
    EXPECT_NO_THROW(m_Filter->Update());
    EXPECT_TRUE(HaveSamePixels(ProjectAfresh(m_Image, m_Filter->GetTransform()), m_Filter->GetOutput()));
  }

  /** A filter that has the image as its output, in memory of its own. */
  auto
  MakeUpstream() const
  {
    const auto cast = itk::CastImageFilter<ImageType, ImageType>::New();
    cast->InPlaceOff();
    cast->SetInput(m_Image);
    return cast;
  }

  void
  FillAnew(std::uint64_t seed) const
  {
    Random random(seed);
    FillRandom(random, m_Image.GetPointer());
    m_Image->Modified();
  }

  ImageType::Pointer  m_Image;
  FilterType::Pointer m_Filter;
};

constexpr itk::SizeValueType BlockExtremaBytes = sizeof(short) * 5 * 6 * 6;
constexpr itk::SizeValueType PreparedBytes = sizeof(short) * 40 * 41 * 42 + BlockExtremaBytes;
} // namespace

TEST_F(ShearWarpMIPPipeline, ViewsPrepareWhatFurtherOnesNeed)
{
  EXPECT_EQ(m_Filter->GetPreparedVolumeSizeInBytes(), 0u);
  const itk::SizeValueType bytes[3][3] = { { 0, BlockExtremaBytes, BlockExtremaBytes },
                                           { PreparedBytes, PreparedBytes, PreparedBytes },
                                           { PreparedBytes, PreparedBytes, PreparedBytes } };
  const bool               isPrepared[3][3] = { { false, false, true }, { false, true, true }, { true, true, true } };
  for (unsigned int repeat = 0; repeat < 3; ++repeat)
  {
    for (const unsigned int axis : { 0, 1, 2 })
    {
      SCOPED_TRACE(testing::Message() << "repeat " << repeat << ", axis " << axis);
      m_Filter->SetTransform(MakeViewAlong(axis));
      m_Filter->Update();
      EXPECT_EQ(m_Filter->GetPrincipalAxis(), axis);
      EXPECT_EQ(GetPreparedBytes(m_Filter.GetPointer()), bytes[repeat][axis]);
      EXPECT_EQ(m_Filter->GetPreparationSeconds() == 0.0, isPrepared[repeat][axis]);
      EXPECT_GT(m_Filter->GetProjectionSeconds(), 0.0);
      EXPECT_GT(m_Filter->GetWarpSeconds(), 0.0);
    }
  }
  m_Filter->SetDefaultPixelValue(5);
  m_Filter->SetTransform(MakeViewAlong(0));
  m_Filter->SetOutputSpacing(MakeVector2(2, 2));
  m_Filter->Update();
  EXPECT_EQ(m_Filter->GetPreparationSeconds(), 0.0) << "parameters prepare nothing either";
}

TEST_F(ShearWarpMIPPipeline, OneViewKeepsNothing)
{
  for (const unsigned int axis : { 0, 1, 2 })
  {
    m_Image->Modified();
    m_Filter->SetTransform(MakeViewAlong(axis));
    m_Filter->Update();
    EXPECT_EQ(GetPreparedBytes(m_Filter.GetPointer()), 0u);
  }
  m_Image->Modified();
  m_Filter->SetReducedResampling(FilterType::ReducedResamplingEnum::On);
  m_Filter->Update();
  EXPECT_EQ(GetPreparedBytes(m_Filter.GetPointer()), BlockExtremaBytes);
}

TEST_F(ShearWarpMIPPipeline, OnlySecondViewsAlongXCopyTheVolume)
{
  for (const unsigned int axis : { 1, 2, 1, 2, 0 })
  {
    m_Filter->SetTransform(MakeViewAlong(axis));
    m_Filter->Update();
    EXPECT_LE(GetPreparedBytes(m_Filter.GetPointer()), BlockExtremaBytes);
  }
  UpdateAnew(m_Filter);
  EXPECT_EQ(GetPreparedBytes(m_Filter.GetPointer()), PreparedBytes);
}

TEST_F(ShearWarpMIPPipeline, FirstViewsHaveTheBitsOfFurtherOnes)
{
  using ModeEnum = FilterType::ModeEnum;
  const std::function<void()> changes[] = {
    [] {},
    [this] { m_Filter->SetSlabFar(3.0); },
    [this] { m_Filter->SetMode(ModeEnum::Minimum); },
    [this] { m_Filter->ComputeDepthOn(); },
    [this] { m_Filter->SetDepthAttenuation(0.01); },
    [this] { m_Filter->LocalMaximumOn(); },
    [this] {
      const auto              mask = MakeMask(m_Image);
      Random                  random(508);
      FillRandom(random, mask.GetPointer());
      m_Filter->SetMaskImage(mask);
    },
  };
  // of several slabs
  Random random(507);
  m_Image = MakeRandomImage<short>(random, { { 130, 140, 150 } });
  m_Filter->SetInput(m_Image);
  for (const auto & change : changes)
  {
    change();
    for (const unsigned int axis : { 0, 1, 2 })
    {
      m_Filter->SetTransform(MakeViewAlong(axis));
      m_Image->Modified();
      m_Filter->Update();
      const auto first = Copy(m_Filter->GetOutput());
      for (int repeat = 0; repeat < 2; ++repeat)
      {
        UpdateAnew(m_Filter);
        EXPECT_TRUE(HaveSamePixels(first, m_Filter->GetOutput()));
      }
    }
  }
}

TEST_F(ShearWarpMIPPipeline, ChangedPixelsOfTheInputOrItsSourcePrepareAgain)
{
  const auto cast = MakeUpstream();
  for (const bool hasSource : { false, true })
  {
    m_Filter->SetInput(hasSource ? cast->GetOutput() : m_Image.GetPointer());
    m_Filter->Update();
    const auto before = Copy(m_Filter->GetOutput());
    FillAnew(hasSource ? 504 : 502);
    m_Filter->Update();
    EXPECT_GT(m_Filter->GetPreparationSeconds(), 0.0);
    EXPECT_FALSE(HaveSamePixels(before, m_Filter->GetOutput()));
    ExpectWorksAgain();
  }
}

TEST_F(ShearWarpMIPPipeline, AnotherInputPreparesAgain)
{
  m_Filter->Update();
  const auto other = MakeTestImage(503);
  m_Filter->SetInput(other);
  m_Filter->Update();
  EXPECT_GT(m_Filter->GetPreparationSeconds(), 0.0);
  EXPECT_TRUE(HaveSamePixels(ProjectAfresh(other, m_Filter->GetTransform()), m_Filter->GetOutput()));
  m_Filter->SetInput(m_Image);
  ExpectWorksAgain();
}

TEST_F(ShearWarpMIPPipeline, InputsOfOtherSizeAndGeometryTakeTurns)
{
  Random random(506);
  for (int repeat = 0; repeat < 60; ++repeat)
  {
    m_Image = MakeRandomImage<short>(random, MakeRandomSize(random, 1, 50));
    m_Filter->SetInput(m_Image);
    m_Filter->SetTransform(MakeRandomView(random, ViewKind::Affine, m_Image));
    ASSERT_NO_THROW(m_Filter->UpdateLargestPossibleRegion());
    ASSERT_TRUE(HaveSamePixels(ProjectAfresh(m_Image, m_Filter->GetTransform()), m_Filter->GetOutput()))
      << "in repetition " << repeat;
  }
}

TEST_F(ShearWarpMIPPipeline, ChangedGeometryOfTheInputTakesEffect)
{
  m_Filter->Update();
  m_Image->SetSpacing(MakeVector3(1.0, 2.0, 0.5));
  ExpectWorksAgain();
  m_Image->SetOrigin(MakePoint3(1.0, 2.0, 0.5));
  ExpectWorksAgain();
}

TEST_F(ShearWarpMIPPipeline, TransformMutatedInPlaceTakesEffect)
{
  const auto euler = itk::Euler3DTransform<double>::New();
  euler->SetRotation(0.2, 0.3, 0.4);
  m_Filter->SetTransform(euler);
  const ExecutionCounter executions(m_Filter);
  m_Filter->Update();
  const auto before = Copy(m_Filter->GetOutput());
  euler->SetRotation(1.2, 0.3, 0.4);
  euler->Modified(); // ITK's SetRotation() does not say so
  m_Filter->Update();
  EXPECT_EQ(executions.GetCount(), 2);
  EXPECT_FALSE(HaveSamePixels(before, m_Filter->GetOutput()));
  ExpectWorksAgain();
}

TEST_F(ShearWarpMIPPipeline, ATransformWithASourceIsMadeBeforeTheGeometry)
{
  ExpectFollowsTheSourceOfItsTransform([this] { return MakeFilter(m_Image); });
  ExpectFollowsTheSourceOfItsTransform([this] {
    const auto filter = itk::ShearWarpMIPImageFilter<ImageType, ImageType>::New();
    filter->SetInput(m_Image);
    filter->SetSlabFar(2.0);
    return filter;
  });
}

TEST_F(ShearWarpMIPPipeline, ATurnsTransformWithASourceIsMadeBeforeTheGeometry)
{
  ExpectFollowsTheSourceOfItsTransform([this] {
    const auto cine = itk::ShearWarpMIPCineImageFilter<ImageType>::New();
    cine->SetInput(m_Image);
    cine->SetNumberOfFrames(3);
    return cine;
  });
}

TEST_F(ShearWarpMIPPipeline, TheTransformOfPartsWithASourceIsMadeBeforeTheGeometry)
{
  const auto source = TransformSource::New();
  const auto parts = MakePartsFilter(m_Filter.GetPointer());
  parts->SetTransformInput(source->GetOutput());
  for (const double angle : { 0.4, -1.3 })
  {
    source->SetAngle(angle);
    parts->UpdateOutputInformation();
    parts->ClearParts();
    parts->AddPart(parts->ProjectPart(m_Image));
    parts->UpdateLargestPossibleRegion();
    const auto expected = ProjectAfresh(m_Image, TransformSource::MakeTransform(angle));
    EXPECT_TRUE(HaveSamePixels(parts->GetOutput(), expected));
  }
}

TEST_F(ShearWarpMIPPipeline, OneSourceOfImageAndTransformRunsOnce)
{
  for (const unsigned int divisions : { 1, 3 })
  {
    SCOPED_TRACE(divisions);
    const auto source = ImageAndTransformSource::New();
    source->SetImage(m_Image);
    const auto filter = MakeFilter(static_cast<const ImageType *>(source->GetOutput()));
    filter->SetTransformInput(source->GetTransformOutput());
    filter->SetNumberOfStreamDivisions(divisions);
    const ExecutionCounter executionsOfSource(source);
    int                    count = 0;
    for (const double angle : { 0.4, -1.3, 2.2 })
    {
      source->SetAngle(angle);
      ASSERT_NO_THROW(filter->UpdateLargestPossibleRegion());
      EXPECT_TRUE(HaveSamePixels(ProjectAfresh(m_Image, TransformSource::MakeTransform(angle)), filter->GetOutput()));
      filter->Update();
      EXPECT_EQ(executionsOfSource.GetCount(), ++count);
    }
  }
}

TEST_F(ShearWarpMIPPipeline, NoChangeExecutesNothing)
{
  SetGrid(m_Filter, { { 20, 20 } }, MakeVector2(1.5, 1.5), MakePoint2(-10, -10));
  m_Filter->SetDefaultPixelValue(3);
  const ExecutionCounter executions(m_Filter);
  m_Filter->Update();
  m_Filter->Update();
  SetGrid(m_Filter, { { 20, 20 } }, MakeVector2(1.5, 1.5), MakePoint2(-10, -10));
  m_Filter->SetDefaultPixelValue(3);
  m_Filter->SetTransform(m_Filter->GetTransform());
  m_Filter->SetInput(m_Image);
  m_Filter->Update();
  m_Filter->UpdateLargestPossibleRegion();
  EXPECT_EQ(executions.GetCount(), 1);
  m_Filter->SetDefaultPixelValue(4);
  m_Filter->Update();
  EXPECT_EQ(executions.GetCount(), 2);
  m_Filter->FitOutputGrid();
  m_Filter->Update();
  m_Filter->FitOutputGrid();
  m_Filter->Update();
  EXPECT_EQ(executions.GetCount(), 3);
}

TEST_F(ShearWarpMIPPipeline, SettingAPartOfTheGridToItsInitialValueStillCounts)
{
  m_Filter->Update();
  m_Filter->SetOutputOrigin(MakePoint2(0.0, 0.0));
  m_Filter->Update();
  EXPECT_EQ(m_Filter->GetOutput()->GetOrigin(), MakePoint2(0.0, 0.0));
  m_Filter->SetOutputSpacing(MakeVector2(0.0, 0.0));
  EXPECT_NAMES(m_Filter->Update(), "OutputSpacing", "0, 0");
}

TEST_F(ShearWarpMIPPipeline, ReleasePreparedVolumeFreesItUntilItIsNeeded)
{
  const auto updateTwice = [this] {
    for (int repeat = 0; repeat < 2; ++repeat)
    {
      UpdateAnew(m_Filter);
    }
    EXPECT_GT(m_Filter->GetPreparationSeconds(), 0.0);
    EXPECT_EQ(GetPreparedBytes(m_Filter.GetPointer()), PreparedBytes);
  };
  updateTwice();
  const auto before = Copy(m_Filter->GetOutput());
  m_Filter->ReleasePreparedVolume();
  EXPECT_EQ(m_Filter->GetPreparedVolumeSizeInBytes(), 0u);
  updateTwice();
  EXPECT_TRUE(HaveSamePixels(before, m_Filter->GetOutput()));
}

TEST_F(ShearWarpMIPPipeline, WorksBetweenTwoOtherFilters)
{
  using FloatImageType = itk::Image<float, 3>;
  const auto before = itk::CastImageFilter<ImageType, FloatImageType>::New();
  before->SetInput(m_Image);
  const auto filter = MakeFilter(before->GetOutput());
  const auto after = itk::CastImageFilter<itk::Image<float, 2>, itk::Image<double, 2>>::New();
  after->SetInput(filter->GetOutput());
  for (const unsigned int axis : { 0, 1, 2, 0 })
  {
    const auto view = MakeViewAlong(axis);
    filter->SetTransform(view);
    after->UpdateLargestPossibleRegion();
    BruteForceProjection<float> bruteForce(view, before->GetOutput());
    const auto                  expected = GetPixels(bruteForce.Evaluate(after->GetOutput(), 0.0f));
    EXPECT_EQ(GetPixels(after->GetOutput()), std::vector<double>(expected.begin(), expected.end()));
  }
}

TEST_F(ShearWarpMIPPipeline, StreamingDownstreamEqualsTheWholeAndExecutesOnce)
{
  const ExecutionCounter executions(m_Filter);
  const auto             streaming = itk::StreamingImageFilter<OutputType, OutputType>::New();
  streaming->SetInput(m_Filter->GetOutput());
  streaming->SetNumberOfStreamDivisions(5);
  streaming->Update();
  EXPECT_EQ(executions.GetCount(), 1);
  EXPECT_TRUE(HaveSamePixels(ProjectAfresh(m_Image, m_Filter->GetTransform()), streaming->GetOutput()));
}

TEST_F(ShearWarpMIPPipeline, RequestedPartEnlargesToTheWholeOutput)
{
  m_Filter->UpdateOutputInformation();
  m_Filter->GetOutput()->SetRequestedRegion(itk::ImageRegion<2>({ { 3, 4 } }, { { 5, 6 } }));
  m_Filter->GetOutput()->PropagateRequestedRegion();
  EXPECT_EQ(m_Filter->GetOutput()->GetRequestedRegion(), m_Filter->GetOutput()->GetLargestPossibleRegion());
  m_Filter->Update();
  EXPECT_EQ(m_Filter->GetOutput()->GetBufferedRegion(), m_Filter->GetOutput()->GetLargestPossibleRegion());
}

TEST_F(ShearWarpMIPPipeline, UpstreamMayReleaseItsData)
{
  const auto cast = MakeUpstream();
  cast->ReleaseDataFlagOn();
  m_Filter->SetInput(cast->GetOutput());
  for (const unsigned int axis : { 0, 0, 1, 2, 0 })
  {
    const auto view = MakeViewAlong(axis);
    m_Filter->SetTransform(view);
    m_Filter->Update();
    EXPECT_TRUE(HaveSamePixels(ProjectAfresh(m_Image, view), m_Filter->GetOutput()));
    EXPECT_EQ(cast->GetOutput()->GetBufferedRegion().GetNumberOfPixels(), 0u) << "released";
  }
}

TEST_F(ShearWarpMIPPipeline, ProgressRisesToOneThroughAllPhases)
{
  Random random(503);
  m_Filter->SetInput(MakeRandomImage<short>(random, { { 150, 150, 150 } }));
  for (const unsigned int workUnits : { 1, 2 })
  {
    m_Filter->SetNumberOfWorkUnits(workUnits);
    m_Filter->ReleasePreparedVolume();
    // along x, in slabs, then with a preparation, then without
    for (const unsigned int view : { 0, 1, 2 })
    {
      m_Filter->Modified();
      ProgressRecorder recorder(m_Filter);
      m_Filter->Update();
      m_Filter->RemoveAllObservers();
      // events come from the calling thread alone: with a second one, from its share
      ASSERT_GT(recorder.progress.size(), workUnits == 1 ? 5u : 0u) << view;
      EXPECT_TRUE(std::is_sorted(recorder.progress.begin(), recorder.progress.end()));
      EXPECT_EQ(recorder.progress.back(), 1.0f);
      EXPECT_EQ(m_Filter->GetProgress(), 1.0f);
      if (workUnits == 1)
      {
        float last = 0.0f;
        for (const float progress : recorder.progress)
        {
          EXPECT_LE(progress - last, 0.25f) << "no phase is silent";
          last = progress;
        }
      }
    }
  }
}

TEST_F(ShearWarpMIPPipeline, AbortThrowsAndTheNextUpdateIsRight)
{
  m_Filter->SetNumberOfWorkUnits(1);
  const auto abortAt = [this](float limit) {
    m_Filter->Modified();
    ProgressRecorder recorder(m_Filter);
    recorder.abortAt = limit;
    EXPECT_THROW(m_Filter->Update(), itk::ProcessAborted) << "at progress " << limit;
    EXPECT_LT(recorder.progress.back(), 1.0f);
    m_Filter->RemoveAllObservers();
  };
  // the preparation, the projection, and the warp
  for (const float limit : { 0.05f, 0.75f, 0.95f })
  {
    m_Filter->ReleasePreparedVolume();
    UpdateAnew(m_Filter);
    abortAt(limit);
    EXPECT_EQ(GetPreparedBytes(m_Filter.GetPointer()), limit < 0.4f ? 0u : PreparedBytes);
    ExpectWorksAgain();
  }

  m_Filter->ReleasePreparedVolume();
  abortAt(0.05f);
  ExpectWorksAgain();
  EXPECT_EQ(GetPreparedBytes(m_Filter.GetPointer()), 0u) << "the first view is to come after an abort";
}

TEST_F(ShearWarpMIPPipeline, AHundredAbortsAtRandomMomentsLeaveTheFilterRight)
{
  using Clock = std::chrono::steady_clock;
  Random random(507);
  m_Image = MakeTestImage(508, { { 90, 100, 110 } });
  m_Filter->SetInput(m_Image);
  std::vector<OutputType::Pointer> expected;
  for (const unsigned int axis : { 0, 1, 2 })
  {
    expected.push_back(ProjectAfresh(m_Image, MakeViewAlong(axis)));
  }

  Clock::duration duration{ std::chrono::milliseconds(10) };
  int             aborts = 0;
  for (int repeat = 0; aborts < 100; ++repeat)
  {
    ASSERT_LT(repeat, 10000) << aborts << " aborts";
    const auto threads = static_cast<itk::ThreadIdType>(random.Integer(1, 8));
    const auto axis = static_cast<unsigned int>(random.Integer(0, 2));
    SetThreads(m_Filter, threads);
    m_Filter->SetTransform(MakeViewAlong(axis));
    m_Filter->ReleasePreparedVolume();
    std::thread aborter([&, delay = random.Uniform(0.0, 1.0) * duration] {
      std::this_thread::sleep_for(delay);
      m_Filter->AbortGenerateDataOn();
    });
    bool        isAborted = false;
    try
    {
      m_Filter->UpdateLargestPossibleRegion();
    }
    catch (const itk::ProcessAborted &)
    {
      isAborted = true;
    }
    aborter.join();
    aborts += isAborted;

    const auto start = Clock::now();
    ASSERT_NO_THROW(m_Filter->UpdateLargestPossibleRegion());
    duration = isAborted ? Clock::now() - start : duration;
    ASSERT_TRUE(HaveSamePixels(expected[axis].GetPointer(), m_Filter->GetOutput())) << "in repetition " << repeat;
  }
}

TEST_F(ShearWarpMIPPipeline, WhatAnObserverThrowsArrivesAndTheNextUpdateIsRight)
{
  m_Image = MakeTestImage(509, { { 20, 150, 150 } });
  m_Filter->SetInput(m_Image);
  for (const unsigned int threads : { 1, 3 })
  {
    SetThreads(m_Filter, threads);
    bool hasThrown = true;
    for (int event = 0; hasThrown; ++event)
    {
      hasThrown = false;
      int eventsUntilThrow = event;
      m_Filter->AddObserver(itk::ProgressEvent(), [&](const itk::EventObject &) {
        // from then on at every event
        if (eventsUntilThrow-- <= 0)
        {
          throw std::runtime_error("from an observer");
        }
      });
      m_Filter->ReleasePreparedVolume();
      m_Filter->Modified();
      try
      {
        m_Filter->Update();
      }
      catch (const std::runtime_error & error)
      {
        hasThrown = true;
        EXPECT_STREQ(error.what(), "from an observer");
      }
      m_Filter->RemoveAllObservers();
      ExpectWorksAgain();
      ASSERT_LT(event, 1000);
    }
  }
}

TEST_F(ShearWarpMIPPipeline, AllocationsThatFailAreErrorsThatNameThemAndTheNextUpdateIsRight)
{
  m_Filter->SetOversampling(2);
  m_Filter->Update();
  std::set<std::string> purposes;
  for (const unsigned int threads : { 1, 3 })
  {
    for (int allocation = 0; allocation < 30; ++allocation)
    {
      const auto filter = MakeFilter(m_Image, m_Filter->GetTransform());
      filter->SetOversampling(2);
      SetThreads(filter, threads);
      allocationsUntilFailure = allocation;
      try
      {
        filter->Update();
        UpdateAnew(filter);
      }
      catch (const itk::MemoryAllocationError & error)
      {
        const std::string description = error.GetDescription();
        EXPECT_NE(description.find(" bytes for "), std::string::npos) << description;
        purposes.insert(description.substr(description.find(" for ") + 5));
      }
      allocationsUntilFailure = -1;
      ASSERT_NO_THROW(filter->Update());
      EXPECT_TRUE(HaveSamePixels(m_Filter->GetOutput(), filter->GetOutput()))
        << "allocation " << allocation << ", " << threads << " threads";
    }
  }
  EXPECT_EQ(purposes,
            (std::set<std::string>{ "an intermediate image.",
                                    "the block maxima.",
                                    "the oversampled intermediate image.",
                                    "the transposed copy of the volume." }));
}

TEST_F(ShearWarpMIPPipeline, FiltersInSeveralThreadsProjectGraftsOfOneImage)
{
  constexpr int                    repeats = 30;
  std::vector<ViewType::Pointer>   views;
  std::vector<OutputType::Pointer> expected;
  Random                           random(510);
  for (int n = 0; n < repeats; ++n)
  {
    views.push_back(MakeRandomView(random, ViewKind::Affine, m_Image));
    expected.push_back(ProjectAfresh(m_Image, views.back()));
  }
  std::atomic<int>         rightPictures{ 0 };
  std::vector<std::thread> threads;
  threads.reserve(4);
  for (int thread = 0; thread < 4; ++thread)
  {
    threads.emplace_back([&] {
      const auto graft = ImageType::New();
      graft->Graft(m_Image);
      const auto filter = MakeFilter(graft);
      for (int n = 0; n < repeats; ++n)
      {
        filter->SetTransform(views[n]);
        filter->UpdateLargestPossibleRegion();
        rightPictures += HaveSamePixels(expected[n].GetPointer(), filter->GetOutput());
      }
    });
  }
  for (std::thread & thread : threads)
  {
    thread.join();
  }
  EXPECT_EQ(rightPictures, 4 * repeats);
}

TEST_F(ShearWarpMIPPipeline, AnUnknownInstructionSetIsAnError)
{
  itksys::SystemTools::PutEnv("SHEARWARPMIP_INSTRUCTION_SET=abacus");
  EXPECT_NAMES(m_Filter->Update(), "SHEARWARPMIP_INSTRUCTION_SET", "abacus", "portable");
  itksys::SystemTools::UnPutEnv("SHEARWARPMIP_INSTRUCTION_SET");
  ExpectWorksAgain();
}

TEST_F(ShearWarpMIPPipeline, ErrorsOfTheTransformNameIt)
{
  m_Filter->SetTransform(nullptr);
  EXPECT_NAMES(m_Filter->Update(), "Transform", "not set");

  const auto spline = itk::BSplineTransform<double, 3>::New();
  m_Filter->SetTransform(spline);
  EXPECT_NAMES(m_Filter->Update(), "Transform", "linear", "BSplineTransform");

  const auto composite = itk::CompositeTransform<double, 3>::New();
  composite->AddTransform(ViewType::New());
  composite->AddTransform(spline);
  m_Filter->SetTransform(composite);
  EXPECT_NAMES(m_Filter->Update(), "Transform", "linear", "CompositeTransform");

  const auto view = ViewType::New();
  auto       parameters = view->GetParameters();
  parameters[8] = 0.0;
  parameters[0] = 3.25;
  view->SetParameters(parameters);
  m_Filter->SetTransform(view);
  EXPECT_NAMES(m_Filter->Update(), "Transform", "invertible", "3.25");

  parameters[8] = std::numeric_limits<double>::quiet_NaN();
  view->SetParameters(parameters);
  EXPECT_NAMES(m_Filter->Update(), "Transform", "finite", "nan", "3.25");

  m_Filter->SetTransform(MakeViewAlong(1));
  ExpectWorksAgain();
}

TEST_F(ShearWarpMIPPipeline, ErrorsOfTheOutputGridNameParameterAndValue)
{
  const double notANumber = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  m_Filter->SetSize({ { 12, 0 } });
  EXPECT_NAMES(m_Filter->Update(), "Size", "[12, 0]");
  m_Filter->FitOutputGrid();
  const auto print = [](double value) {
    std::ostringstream out;
    out << value;
    return out.str();
  };
  for (const double bad : { 0.0, -1.5, notANumber, infinity })
  {
    m_Filter->SetOutputSpacing(MakeVector2(0.75, bad));
    EXPECT_NAMES(m_Filter->Update(), "OutputSpacing", "0.75", print(bad));
  }
  m_Filter->FitOutputGrid();
  for (const double bad : { notANumber, infinity, -infinity })
  {
    m_Filter->SetOutputOrigin(MakePoint2(bad, 0.75));
    EXPECT_NAMES(m_Filter->Update(), "OutputOrigin", print(bad), "0.75");
  }
  m_Filter->FitOutputGrid();
  ExpectWorksAgain();
}

TEST_F(ShearWarpMIPPipeline, OutputLargerThanTheMemoryIsAnErrorThatNamesIt)
{
  m_Filter->SetSize({ { itk::SizeValueType{ 1 } << 40, itk::SizeValueType{ 1 } << 40 } });
  EXPECT_NAMES(m_Filter->Update(), "Size", "memory");
  m_Filter->FitOutputGrid();
  m_Filter->SetOutputSpacing(MakeVector2(1e-12, 1.0));
  EXPECT_NAMES(m_Filter->Update(), "1 x [", "OutputSpacing", "memory", "1e-12", " GB");
  m_Filter->FitOutputGrid();
  m_Filter->SetOutputOrigin(MakePoint2(-1e300, 0.0));
  EXPECT_NAMES(m_Filter->Update(), "memory");
  m_Filter->FitOutputGrid();
  ExpectWorksAgain();
}

TEST_F(ShearWarpMIPPipeline, ErrorsOfTheInputNameTheValue)
{
  m_Filter->SetInput(nullptr);
  EXPECT_NAMES(m_Filter->Update(), "Primary");

  const auto empty = ImageType::New();
  empty->SetRegions(itk::Size<3>{ { 7, 0, 5 } });
  empty->Allocate();
  m_Filter->SetInput(empty);
  EXPECT_NAMES(m_Filter->Update(), "input", "empty", "[7, 0, 5]");

  const double notANumber = std::numeric_limits<double>::quiet_NaN();
  const auto   image = MakeTestImage(505);
  m_Filter->SetInput(image);
  image->SetOrigin(MakePoint3(0.75, 0.0, notANumber));
  EXPECT_NAMES(m_Filter->Update(), "origin", "0.75", "nan");

  const auto unallocated = ImageType::New();
  unallocated->SetRegions(itk::Size<3>{ { 7, 6, 5 } });
  m_Filter->SetInput(unallocated);
  EXPECT_NAMES(m_Filter->Update(), "input", "buffered", "[7, 6, 5]", "0 voxels");

  const auto source = ScantImageSource::New();
  m_Filter->SetInput(source->GetOutput());
  EXPECT_NAMES(m_Filter->Update(), "input", "buffered", "[40, 41, 42]", "34440 voxels", "[40, 41, 21]", "[0, 0, 21]");

  m_Filter->SetInput(m_Image);
  ExpectWorksAgain();
}

TEST_F(ShearWarpMIPPipeline, AnUpstreamThatHasComputedAPartComputesTheRest)
{
  const auto                cast = MakeUpstream();
  const itk::ImageRegion<3> part({ { 3, 4, 5 } }, { { 6, 7, 8 } });
  cast->UpdateOutputInformation();
  cast->GetOutput()->SetRequestedRegion(part);
  cast->Update();
  ASSERT_EQ(cast->GetOutput()->GetBufferedRegion(), part);
  m_Filter->SetInput(cast->GetOutput());
  ExpectWorksAgain();
}

TEST_F(ShearWarpMIPPipeline, ErrorsLeaveTheUpstreamUntouched)
{
  const auto             cast = MakeUpstream();
  const ExecutionCounter executions(cast);
  m_Filter->SetInput(cast->GetOutput());
  m_Filter->SetOutputSpacing(MakeVector2(-1, 1));
  EXPECT_NAMES(m_Filter->Update(), "OutputSpacing");
  EXPECT_EQ(executions.GetCount(), 0) << "parameters are checked before anything is computed";
}

TEST_F(ShearWarpMIPPipeline, SetGetAndPrintEveryParameter)
{
  EXPECT_STREQ(m_Filter->GetNameOfClass(), "ShearWarpMIPImageFilter");
  EXPECT_EQ(m_Filter->GetDefaultPixelValue(), 0);
  ExpectPrinted(m_Filter,
                { "Transform: ",
                  "Size: [0, 0] (fitted)",
                  "OutputSpacing: [0, 0] (fitted)",
                  "OutputOrigin: [0, 0] (fitted)",
                  "DefaultPixelValue: 0\n",
                  "ReducedResampling: itk::ShearWarpMIPImageFilterEnums::ReducedResampling::Auto",
                  "Oversampling: 1\n",
                  "NumberOfStreamDivisions: 1\n",
                  "SkippedFraction: 0",
                  "InstructionSet: portable",
                  "PrincipalAxis: 2",
                  "PreparationSeconds: 0",
                  "ProjectionSeconds: 0",
                  "WarpSeconds: 0",
                  "PreparedVolumeSizeInBytes: 0" });

  SetGrid(m_Filter, { { 11, 12 } }, MakeVector2(1.5, 2.5), MakePoint2(-3.5, 4.5));
  m_Filter->SetDefaultPixelValue(-77);
  m_Filter->SetOversampling(2);
  m_Filter->Update();
  EXPECT_EQ(m_Filter->GetSize(), (itk::Size<2>{ { 11, 12 } }));
  EXPECT_EQ(m_Filter->GetOutputSpacing(), MakeVector2(1.5, 2.5));
  EXPECT_EQ(m_Filter->GetOutputOrigin(), MakePoint2(-3.5, 4.5));
  EXPECT_EQ(m_Filter->GetDefaultPixelValue(), -77);
  EXPECT_EQ(m_Filter->GetPrincipalAxis(), 0u);
  ExpectPrinted(m_Filter,
                { "Size: [11, 12]\n",
                  "OutputSpacing: [1.5, 2.5]\n",
                  "OutputOrigin: [-3.5, 4.5]\n",
                  "DefaultPixelValue: -77\n",
                  "Oversampling: 2\n",
                  "PrincipalAxis: 0",
                  "PreparedVolumeSizeInBytes: " + std::to_string(m_Filter->GetPreparedVolumeSizeInBytes()) });

  // a number, not a letter
  const auto bytes = itk::ShearWarpMIPImageFilter<itk::Image<unsigned char, 3>>::New();
  bytes->SetDefaultPixelValue(65);
  ExpectPrinted(bytes, { "DefaultPixelValue: 65\n" });
}

TEST_F(ShearWarpMIPPipeline, TransformIsTheIdentityByDefault)
{
  const auto filter = MakeFilter(m_Image);
  filter->Update();
  ASSERT_NE(filter->GetTransform(), nullptr);
  EXPECT_EQ(filter->GetTransform()->TransformPoint(MakePoint3(1, 2, 3)), MakePoint3(1, 2, 3));
  EXPECT_EQ(filter->GetPrincipalAxis(), 2u);
  EXPECT_EQ(filter->GetOutput()->GetBufferedRegion().GetSize(), (itk::Size<2>{ { 40, 41 } }));
}

TEST_F(ShearWarpMIPPipeline, CopiesOfTheOutputSurviveTheNextView)
{
  m_Filter->Update();
  OutputType::Pointer first = m_Filter->GetOutput();
  const auto          expected = Copy(first.GetPointer());
  first->DisconnectPipeline();
  m_Filter->SetTransform(MakeViewAlong(2));
  m_Filter->Update();
  EXPECT_TRUE(HaveSamePixels(expected, first.GetPointer()));
  ExpectWorksAgain();
}
