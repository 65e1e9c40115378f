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
#ifndef Animation_h
#define Animation_h

#include "AnyImage.h"

#include <filesystem>

/** Throws if the program ffmpeg, which encodes animations, is not there. */
void
RequireAnimationEncoder();

/** Encodes \a pictures, of 8 bits and one or three components, as the extension of \a path says: .gif and .apng, which
 * are repeated for ever and keep every grey value, or .mp4 (H.264). Colours of a GIF are 256 of all.
 *
 * \a rate is in pictures per second; \a raw is a file that may be overwritten. Throws if a file cannot be written. */
void
EncodeAnimation(const AnyImage &              pictures,
                double                        rate,
                const std::filesystem::path & raw,
                const std::filesystem::path & path);

#endif
