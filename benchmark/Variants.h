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
#ifndef Variants_h
#define Variants_h

#include "Subject.h"

#include "itkImageRegionIteratorWithIndex.h"

#include <functional>

namespace itk::ShearWarpBenchmark
{
/** A parameter that is set for one update and then set back; its time is a ratio to that without, of the views
 * along the same axes. */
template <typename TFilter>
struct Variant
{
  std::string                    counter;
  std::function<void(TFilter &)> set;
  std::function<void(TFilter &)> reset;
  bool                           isFirstView{ false };
  std::vector<unsigned int>      principalAxes{ 0, 1, 2 };
};

/** A ball in the middle, of a diameter of \a fraction of the volume's extent. */
inline Image<unsigned char, 3>::Pointer
MakeBall(const ImageBase<3> * volume, double fraction)
{
  const auto mask = Image<unsigned char, 3>::New();
  mask->CopyInformation(volume);
  mask->SetRegions(volume->GetLargestPossibleRegion());
  mask->Allocate();
  const Size<3> size = volume->GetLargestPossibleRegion().GetSize();
  for (ImageRegionIteratorWithIndex<Image<unsigned char, 3>> it(mask, mask->GetBufferedRegion()); !it.IsAtEnd(); ++it)
  {
    double squaredRadius = 0.0;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      const double position = 2.0 * static_cast<double>(it.GetIndex()[axis]) / static_cast<double>(size[axis]) - 1.0;
      squaredRadius += position * position;
    }
    it.Set(squaredRadius <= fraction * fraction ? 1 : 0);
  }
  return mask;
}

/** Slab and box have a tenth and an eighth of the volume. */
template <typename TPixel>
std::vector<Variant<ShearWarpMIPImageFilter<Image<TPixel, 3>>>>
MakeVariants(const Subject<TPixel> & subject)
{
  using FilterType = ShearWarpMIPImageFilter<Image<TPixel, 3>>;
  using Mode = ShearWarpMIPImageFilterEnums::Mode;
  const auto *     volume = subject.volume.GetPointer();
  constexpr double infinity = std::numeric_limits<double>::infinity();
  const auto       setMode = [](Mode mode) { return [mode](FilterType & filter) { filter.SetMode(mode); }; };
  const auto       setSlab = [](double near, double far) {
    return [=](FilterType & filter) {
      filter.SetSlabNear(near);
      filter.SetSlabFar(far);
    };
  };
  const auto setBox = [](const Point<double, 3> & lower, const Point<double, 3> & upper) {
    return [=](FilterType & filter) {
      filter.SetCropLower(lower);
      filter.SetCropUpper(upper);
    };
  };
  const Size<3> size = volume->GetLargestPossibleRegion().GetSize();
  const double  depth =
    subject.output->GetSpacing()[0] * static_cast<double>(subject.output->GetBufferedRegion().GetSize(0));
  Point<double, 3>           lower;
  Point<double, 3>           upper;
  ContinuousIndex<double, 3> quarter;
  ContinuousIndex<double, 3> threeQuarters;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    quarter[axis] = 0.25 * static_cast<double>(size[axis]);
    threeQuarters[axis] = 0.75 * static_cast<double>(size[axis]);
  }
  volume->TransformContinuousIndexToPhysicalPoint(quarter, lower);
  volume->TransformContinuousIndexToPhysicalPoint(threeQuarters, upper);
  const auto threshold = static_cast<TPixel>(subject.maximum / 2);
  const auto setMask = [volume](double fraction) {
    return [mask = MakeBall(volume, fraction)](FilterType & filter) { filter.SetMaskImage(mask); };
  };
  const auto removeMask = [](FilterType & filter) { filter.SetMaskImage(nullptr); };
  const auto release = [](FilterType & filter) { filter.ReleasePreparedVolume(); };
  const auto keep = [](FilterType &) {};
  return {
    { "first_ratio", release, keep, true, { 1, 2 } },
    { "first_x_ratio", release, keep, true, { 0 } },
    { "minimum_ratio", setMode(Mode::Minimum), setMode(Mode::Maximum) },
    { "absolute_ratio", setMode(Mode::AbsoluteMaximum), setMode(Mode::Maximum) },
    { "depth_ratio",
      [](FilterType & filter) { filter.ComputeDepthOn(); },
      [](FilterType & filter) { filter.ComputeDepthOff(); } },
    { "slab_ratio", setSlab(-0.05 * depth, 0.05 * depth), setSlab(-infinity, infinity) },
    { "box_ratio", setBox(lower, upper), setBox(Point<double, 3>(-infinity), Point<double, 3>(infinity)) },
    { "mask_ratio", setMask(0.7), removeMask },
    { "small_mask_ratio", setMask(0.57), removeMask },
    { "local_ratio",
      [threshold](FilterType & filter) {
        filter.LocalMaximumOn();
        filter.SetLocalMaximumThreshold(threshold);
      },
      [](FilterType & filter) { filter.LocalMaximumOff(); } },
    { "fading_ratio",
      [depth](FilterType & filter) { filter.SetDepthAttenuation(1.0 / depth); },
      [](FilterType & filter) { filter.SetDepthAttenuation(0.0); } },
    { "exact_ratio", [](FilterType & filter) { filter.ExactOn(); }, [](FilterType & filter) { filter.ExactOff(); } },
  };
}
} // namespace itk::ShearWarpBenchmark

#endif
