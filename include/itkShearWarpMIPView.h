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
#ifndef itkShearWarpMIPView_h
#define itkShearWarpMIPView_h

#include "ShearWarpMIPExport.h"
#include "itkAffineTransform.h"
#include "itkImageBase.h"

#include <iosfwd>

namespace itk
{
namespace ShearWarp
{
/** Returns the angle of frame \a frame of \a frames. A turn has start + range frame / frames. To and fro has start +
 * range / 2 sin(2 pi frame / frames), scaled to reach the ends of the range. */
ShearWarpMIP_EXPORT double
GetTurnAngle(unsigned int frame, unsigned int frames, double start, double range, bool isRocking);

/** Throws ExceptionObject, with the value, if a parameter of ShearWarpMIPCineImageFilter is not finite, or \a axis is
 * zero. */
ShearWarpMIP_EXPORT void
VerifyTurn(const Vector<double, 3> & axis, const Point<double, 3> & center, double start, double range);
} // namespace ShearWarp

/** \class ShearWarpMIPViewEnums
 * \brief Enumerations of ShearWarpMIPView.
 * \ingroup ShearWarpMIP
 */
class ShearWarpMIPViewEnums
{
public:
  /// The side of the patient from which the viewer looks.
  enum class Direction : uint8_t
  {
    Anterior,
    Posterior,
    Left,
    Right,
    Superior,
    Inferior
  };
};

/** Writes the enumerator's name. */
ShearWarpMIP_EXPORT std::ostream &
                    operator<<(std::ostream & out, ShearWarpMIPViewEnums::Direction value);

/** \class ShearWarpMIPView
 * \brief Makes view transforms for ShearWarpMIPImageFilter from anatomical directions.
 *
 * Physical space is ITK's: x to the patient's left, y to posterior, z to superior (LPS), in mm. View space has u to the
 * right of the picture, v down the picture and w away from the viewer. View space is right-handed, so no view is
 * mirrored. Its origin is the center of the image.
 *
 * u, v and w point towards these sides of the patient:
 * - Anterior: left, inferior, posterior
 * - Posterior: right, inferior, anterior
 * - Left: posterior, inferior, right
 * - Right: anterior, inferior, left
 * - Superior: right, posterior, inferior
 * - Inferior: left, posterior, superior
 *
 * \ingroup ShearWarpMIP
 */
class ShearWarpMIPView
{
public:
  using DirectionEnum = ShearWarpMIPViewEnums::Direction;
  using TransformType = AffineTransform<double, 3>;

  /** Returns the rigid transform, from view space to physical space, of a view of \a image. The viewer starts at
   * \a direction, and moves around the image's center: first by \a azimuth degrees towards the right of the picture,
   * about the picture's vertical axis, then by \a elevation degrees towards the top of the picture. From anterior,
   * azimuth 90 is the left view; a positive azimuth is left anterior oblique, and a positive elevation is cranial.
   * Throws ExceptionObject if \a image is null or has no voxels, as before its filter's UpdateOutputInformation(), or
   * an angle is not finite. */
  static ShearWarpMIP_EXPORT TransformType::Pointer
  MakeTransform(const ImageBase<3> * image, DirectionEnum direction, double azimuth = 0.0, double elevation = 0.0);

  /** Returns the rigid transform of a view of \a image with \a axis up the picture. \a axis is a direction in physical
   * space, of any length. The view is from anterior or, if the axis points that way, from superior. Throws
   * ExceptionObject if \a image is null, or \a axis is zero or not finite. */
  static ShearWarpMIP_EXPORT TransformType::Pointer
                             MakeUprightTransform(const ImageBase<3> * image, const Vector<double, 3> & axis);

  /** Returns \a view, a linear transform from view space to physical space, after the viewer has moved by \a degrees,
   * right-handed. The viewer moves about the line through \a center, in mm, along \a axis, of any length. Multiples of
   * 90 degrees about an axis of physical space are exact. Throws ExceptionObject if \a view is null or not linear, if
   * \a axis is zero, or if a number is not finite. */
  static ShearWarpMIP_EXPORT TransformType::Pointer
                             Turn(const Transform<double, 3, 3> * view,
                                  const Vector<double, 3> &       axis,
                                  const Point<double, 3> &        center,
                                  double                          degrees);

  /** Returns the physical position, in mm, of the center of \a image's largest possible region. */
  static ShearWarpMIP_EXPORT Point<double, 3>
                             GetCenter(const ImageBase<3> * image);
};
} // namespace itk

#endif
