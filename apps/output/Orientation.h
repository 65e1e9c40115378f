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
#ifndef Orientation_h
#define Orientation_h

#include "itkTransform.h"

#include <string>

/** Where an \a axis of view space (0 right, 1 down, 2 away) points in the patient (LPS), in mm per mm in the view. */
itk::Vector<double, 3>
ComputeAxis(const itk::Transform<double, 3, 3> * transform, unsigned int axis);

/** Sides of the patient at the edges of a picture, of one or two letters: L, R, A, P, H, F or, where the view is
 * oblique, as LA with the nearer side first (of two equally near ones L, R, then A, P). A second side has at least sin
 * 22.5 degrees. DICOM PS3.3 C.7.6.1.1.1. */
struct EdgeLetters
{
  std::string left;
  std::string right;
  std::string top;
  std::string bottom;
};

/** The letters of a picture whose \a transform is from view space (right, down, away) to the patient's (LPS). */
EdgeLetters
ComputeEdgeLetters(const itk::Transform<double, 3, 3> * transform);

/** Where a picture is seen from, in degrees: as longitude, 0 from anterior and 90 from the patient's left, more than
 * -180 to 180, and as latitude, 90 from superior. DICOM PS3.3 C.8.7.5.1.2, Positioner Primary and Secondary Angles. */
struct ViewAngles
{
  double primary;
  double secondary;
};

/** The angles of a picture with a \a transform as above. Where secondary is 90 or -90, primary is the angle of the
 * view from which the viewer rises or descends to this picture. */
ViewAngles
ComputeViewAngles(const itk::Transform<double, 3, 3> * transform);

#endif
