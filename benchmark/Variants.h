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

#include "itkIndexRange.h"

#include <functional>
#include <set>

namespace itk::ShearWarpBenchmark
{
/** One quantity, measured several times for each view. */
using ViewSeries = std::map<unsigned int, std::vector<double>>;

/** A parameter that is set for one update and then set back; its time is a ratio to that without, of the same views. */
template <typename TFilter>
struct Variant
{
  std::string                          counter;
  std::function<void(TFilter &, bool)> set; // or sets back
  bool                                 isFirstView{ false };
  std::set<unsigned int>               principalAxes{ 0, 1, 2 };
  ViewSeries                           seconds{};
  ViewSeries                           unchangedSeconds{};
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
  for (const Index<3> & index : ImageRegionIndexRange<3>(mask->GetBufferedRegion()))
  {
    Vector<double, 3> position;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      position[axis] = 2.0 * static_cast<double>(index[axis]) / static_cast<double>(size[axis]) - 1.0;
    }
    mask->SetPixel(index, position.GetSquaredNorm() <= fraction * fraction ? 1 : 0);
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
  const auto *            volume = subject.volume.GetPointer();
  static constexpr double infinity = std::numeric_limits<double>::infinity();
  const Size<3>           size = volume->GetLargestPossibleRegion().GetSize();
  const double            depth =
    subject.output->GetSpacing()[0] * static_cast<double>(subject.output->GetBufferedRegion().GetSize(0));
  const auto threshold = static_cast<TPixel>(subject.maximum / 2);
  const auto getPoint = [volume, size](SizeValueType quarters) {
    Index<3> index;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      index[axis] = static_cast<IndexValueType>(quarters * size[axis] / 4);
    }
    return volume->template TransformIndexToPhysicalPoint<double>(index);
  };
  const auto setMode = [](Mode mode) {
    return [mode](FilterType & filter, bool isOn) { filter.SetMode(isOn ? mode : Mode::Maximum); };
  };
  const auto setMask = [volume](double fraction) {
    return [mask = MakeBall(volume, fraction)](FilterType & filter, bool isOn) {
      filter.SetMaskImage(isOn ? mask.GetPointer() : nullptr);
    };
  };
  const auto release = [](FilterType & filter, bool isOn) {
    if (isOn)
    {
      filter.ReleasePreparedVolume();
    }
  };
  return {
    { "first_ratio", release, true, { 1, 2 } },
    { "first_x_ratio", release, true, { 0 } },
    { "minimum_ratio", setMode(Mode::Minimum) },
    { "absolute_ratio", setMode(Mode::AbsoluteMaximum) },
    { "mean_ratio", setMode(Mode::Mean) },
    { "nearest_ratio",
      [](FilterType & filter, bool isOn) {
        using Interpolation = ShearWarpMIPImageFilterEnums::Interpolation;
        filter.SetInterpolation(isOn ? Interpolation::Nearest : Interpolation::Linear);
      } },
    { "depth_ratio", [](FilterType & filter, bool isOn) { filter.SetComputeDepth(isOn); } },
    { "slab_ratio",
      [depth](FilterType & filter, bool isOn) {
        filter.SetSlabNear(isOn ? -0.05 * depth : -infinity);
        filter.SetSlabFar(isOn ? 0.05 * depth : infinity);
      } },
    { "box_ratio",
      [lower = getPoint(1), upper = getPoint(3)](FilterType & filter, bool isOn) {
        filter.SetCropLower(isOn ? lower : Point<double, 3>(-infinity));
        filter.SetCropUpper(isOn ? upper : Point<double, 3>(infinity));
      } },
    { "mask_ratio", setMask(0.7) },
    { "small_mask_ratio", setMask(0.57) },
    { "local_ratio",
      [threshold](FilterType & filter, bool isOn) {
        filter.SetLocalMaximum(isOn);
        filter.SetLocalMaximumThreshold(threshold);
      } },
    { "fading_ratio",
      [depth](FilterType & filter, bool isOn) { filter.SetDepthAttenuation(isOn ? 1.0 / depth : 0.0); } },
    { "exact_ratio", [](FilterType & filter, bool isOn) { filter.SetExact(isOn); } },
  };
}
} // namespace itk::ShearWarpBenchmark

#endif
