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
#include "Guard.h"
#include "InputFiles.h"

#include "itkCompositeTransform.h"
#include "itkIdentityTransform.h"
#include "itkTransformFactoryBase.h"
#include "itkTransformFileReader.h"
#include "itkTransformIOFactory.h"
#include "itkVersion.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <list>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <typeinfo>

namespace
{
namespace fs = std::filesystem;
using TransformBase = itk::TransformBaseTemplate<double>;
using TransformType = itk::Transform<double, 3, 3>;
using Transforms = std::vector<TransformType::Pointer>;
using CompositeType = itk::CompositeTransform<double, 3>;

/** What a file says of a transform: its type and numbers, which need not go together. */
class TransformRecord : public itk::IdentityTransform<double, 3>
{
public:
  using Pointer = itk::SmartPointer<TransformRecord>;

  static Pointer
  New(const std::string & type)
  {
    const Pointer record = new TransformRecord(type);
    record->UnRegister();
    return record;
  }

  void
  SetParameters(const ParametersType & parameters) override
  {
    this->m_Parameters = parameters;
  }

  void
  SetFixedParameters(const FixedParametersType & parameters) override
  {
    this->m_FixedParameters = parameters;
  }

  std::string
  GetTransformTypeAsString() const override
  {
    return m_Type;
  }

private:
  explicit TransformRecord(const std::string & type)
    : m_Type(type)
  {}

  std::string m_Type;
};

/** While it is registered, ITK's readers fill records. They check no numbers, and a transform that gets too few or too
 * many reads and writes beyond its memory. */
class RecordFactory : public itk::ObjectFactoryBase
{
public:
  using Self = RecordFactory;
  using Pointer = itk::SmartPointer<Self>;
  itkFactorylessNewMacro(Self);

  const char *
  GetITKSourceVersion() const override
  {
    return ITK_SOURCE_VERSION;
  }

  const char *
  GetDescription() const override
  {
    return "Records of transforms";
  }

protected:
  itk::LightObject::Pointer
  CreateObject(const char * name) override
  {
    const std::string type(name);
    if (type == typeid(itk::TransformFileReaderTemplate<double>).name())
    {
      throw std::runtime_error("a file that names others, maybe itself");
    }
    return type.find("_double_") == std::string::npos ? nullptr : TransformRecord::New(type).GetPointer();
  }
};

/** Whether the vectors of a MATLAB file are whole, and fill it. ITK's reader does not ask. */
bool
IsWholeMATLAB(const fs::path & path)
{
  // the types that need no swapping of bytes; others do
  const std::set<std::int32_t> native = { 0, 10, 100, 110, 1000, 1100, 1110 };
  const auto                   size = static_cast<std::int64_t>(fs::file_size(path));
  std::int64_t                 end = 0;
  std::ifstream                file(path, std::ios::binary);
  while (end < size)
  {
    std::array<std::int32_t, 5> header{};
    file.seekg(end);
    file.read(reinterpret_cast<char *>(header.data()), sizeof(header));
    if (native.count(header[0]) == 0)
    {
      for (std::int32_t & number : header)
      {
        auto * const bytes = reinterpret_cast<char *>(&number);
        std::reverse(bytes, bytes + sizeof(number));
      }
    }
    const auto [type, rows, columns, isComplex, nameLength] = header;
    if (!file || rows < 0 || columns != 1 || isComplex != 0 || nameLength < 0)
    {
      return false;
    }
    const std::int64_t bytes = type % 100 < 10 ? sizeof(double) : sizeof(float);
    end += static_cast<std::int64_t>(sizeof(header)) + nameLength + rows * bytes;
  }
  return end == size;
}

using Records = std::list<TransformBase::Pointer>;

Records
ReadRecords(const fs::path & path)
{
  const std::string name = path.string();
  const auto        io =
    itk::TransformIOFactoryTemplate<double>::CreateTransformIO(name.c_str(), itk::IOFileModeEnum::ReadMode);
  if (!io || (path.extension() == ".mat" && !IsWholeMATLAB(path)))
  {
    return {};
  }
  // a type that has a factory is not registered later
  itk::TransformFactoryBase::RegisterDefaultTransforms();
  const auto factory = RecordFactory::New();
  RecordFactory::RegisterFactory(factory, itk::ObjectFactoryEnums::InsertionPosition::INSERT_AT_FRONT);
  const std::unique_ptr<RecordFactory, decltype(&RecordFactory::UnRegisterFactory)> registered(
    factory, RecordFactory::UnRegisterFactory);
  io->SetFileName(name);
  io->Read();
  return io->GetReadTransformList();
}

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
MakeTransforms(const Records & records)
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
  try
  {
    const Parsing parsing(path, unreadable);
    const Records records = ReadRecords(path);
    if (records.empty())
    {
      throw std::runtime_error(unreadable);
    }
    return MakeTransforms(records);
  }
  catch (const WrongTransform & error)
  {
    throw std::runtime_error(name + error.what());
  }
  // HDF5 throws what is no std::exception
  catch (...)
  {
    throw std::runtime_error(unreadable);
  }
}
