#!/usr/bin/env python3

#
#  Copyright NumFOCUS
#
#  Licensed under the Apache License, Version 2.0 (the "License");
#  you may not use this file except in compliance with the License.
#  You may obtain a copy of the License at
#
#         https://www.apache.org/licenses/LICENSE-2.0.txt
#
#  Unless required by applicable law or agreed to in writing, software
#  distributed under the License is distributed on an "AS IS" BASIS,
#  WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
#  See the License for the specific language governing permissions and
#  limitations under the License.
#

import argparse

import itk

parser = argparse.ArgumentParser(description="Project the maximum intensity of a 3D image.")
parser.add_argument("input_image")
parser.add_argument("output_image")
parser.add_argument("azimuth", type=float)
arguments = parser.parse_args()

image = itk.imread(arguments.input_image, itk.SS)

view = itk.ShearWarpMIPView.MakeTransform(image, itk.ShearWarpMIPViewEnums.Direction_Anterior, arguments.azimuth)
mip = itk.shear_warp_mip_image_filter(image, transform=view)

itk.imwrite(mip, arguments.output_image)
