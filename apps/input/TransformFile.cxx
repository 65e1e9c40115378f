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
#include "TransformFile.h"
#include "InputFiles.h"
#include "Integrity.h"
#include "TransformRecords.h"

#include "itkCompositeTransform.h"

#include <algorithm>
#include <stdexcept>

namespace
{
namespace fs = std::filesystem;
using TransformBase = itk::TransformBaseTemplate<double>;
using TransformType = itk::Transform<double, 3, 3>;
using Transforms = std::vector<TransformType::Pointer>;
using CompositeType = itk::CompositeTransform<double, 3>;

TransformBase::Pointer
CreateTransform(const std::string & type)
{
  const auto object = itk::ObjectFactoryBase::CreateInstance(type.c_str());
  if (object)
  {
    // one reference is the factory's
    object->UnRegister();
  }
  return dynamic_cast<TransformBase *>(object.GetPointer());
}

/** Thrown for a file that ITK reads. */
class WrongTransform : public std::runtime_error
{
  using std::runtime_error::runtime_error;
};

TransformType::Pointer
MakeTransform(const TransformBase & record)
{
  const std::string type = record.GetTransformTypeAsString();
  const auto        created = CreateTransform(type);
  const auto        transform = dynamic_cast<TransformType *>(created.GetPointer());
  if (created && (!transform || !transform->IsLinear()))
  {
    throw WrongTransform("holds a " + type + "; a linear 3D transform is needed");
  }
  if (!dynamic_cast<CompositeType *>(transform))
  {
    if (!transform || record.GetParameters().size() != transform->GetNumberOfParameters())
    {
      throw std::runtime_error("not so many numbers as " + type + " has");
    }
    transform->SetFixedParameters(record.GetFixedParameters());
    transform->SetParametersByValue(record.GetParameters());
  }
  return transform;
}

/** A composite transform is the first in its file and consists of the others. */
Transforms
MakeTransforms(const TransformRecords & records)
{
  Transforms transforms;
  for (const auto & record : records)
  {
    transforms.push_back(MakeTransform(*record));
    if (dynamic_cast<CompositeType *>(transforms.back().GetPointer()) && (transforms.size() > 1 || records.size() == 1))
    {
      throw WrongTransform("holds an empty composite transform");
    }
  }
  const auto composite = transforms.empty() ? nullptr : dynamic_cast<CompositeType *>(transforms.front().GetPointer());
  if (!composite)
  {
    return transforms;
  }
  std::for_each(
    transforms.begin() + 1, transforms.end(), [composite](const auto & part) { composite->AddTransform(part); });
  return { composite };
}
} // namespace

Transforms
ReadLinearTransforms(const fs::path & path)
{
  const std::string name = "'" + path.string() + "' ";
  RequireReadable(path);
  const std::string unreadable = name + "is not a transform that ITK can read";
  if (Check(FileKind::Transform, { path.string() }).front() != Soundness::Sound)
  {
    throw std::runtime_error(unreadable);
  }
  try
  {
    return MakeTransforms(ReadTransformRecords(path));
  }
  catch (const WrongTransform & error)
  {
    throw std::runtime_error(name + error.what());
  }
  catch (const std::exception &)
  {
    throw std::runtime_error(unreadable);
  }
}
