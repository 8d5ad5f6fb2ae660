// Variables of Matlab's files. MAT 5 is read by libmatio, MAT 7.3 as the HDF5 file that it is.
#include <hdf5.h>
#include <matio.h>

#include <limits>

#include "tools/io/arrays/arrays.h"

namespace thicklens::io {
namespace {

constexpr int kMostVariables = 1000;
constexpr int kMostAxes = 32;
constexpr std::size_t kMostTasks = 100;
constexpr std::size_t kMostLetters = 200;

StoredNumber NumberOfClass(const matvar_t& variable) {
  if (variable.isComplex != 0 || variable.isLogical != 0) return StoredNumber::kOther;
  switch (variable.class_type) {
    case MAT_C_UINT8:
      return StoredNumber::kUint8;
    case MAT_C_UINT16:
      return StoredNumber::kUint16;
    case MAT_C_SINGLE:
      return StoredNumber::kFloat;
    case MAT_C_DOUBLE:
      return StoredNumber::kDouble;
    default:
      return StoredNumber::kOther;
  }
}

std::string WordsOfClass(const matvar_t& variable) {
  if (variable.isComplex != 0) return "complex numbers";
  if (variable.isLogical != 0) return "logical values";
  switch (variable.class_type) {
    case MAT_C_UINT8:
      return "unsigned 8-bit integers";
    case MAT_C_UINT16:
      return "unsigned 16-bit integers";
    case MAT_C_SINGLE:
      return "32-bit floats";
    case MAT_C_DOUBLE:
      return "64-bit floats";
    case MAT_C_INT8:
    case MAT_C_INT16:
    case MAT_C_INT32:
    case MAT_C_INT64:
      return "signed integers";
    case MAT_C_UINT32:
    case MAT_C_UINT64:
      return "unsigned integers of more than 16 bits";
    case MAT_C_STRUCT:
      return "a structure";
    case MAT_C_CELL:
      return "cells";
    case MAT_C_SPARSE:
      return "a sparse matrix";
    default:
      return "no numbers";
  }
}

std::string TextOf(const matvar_t* text) {
  if (text == nullptr || text->class_type != MAT_C_CHAR || text->data == nullptr ||
      text->rank < 1) {
    return "";
  }
  std::size_t count = 1;
  for (int i = 0; i < text->rank; ++i) count *= text->dims[i];
  std::string letters;
  // Matlab writes UTF-16 or UTF-8.
  const bool is_wide = text->data_type == MAT_T_UINT16 || text->data_type == MAT_T_UTF16;
  if (count > kMostLetters || text->nbytes < count * (is_wide ? 2 : 1)) return "";
  for (std::size_t i = 0; i < count; ++i) {
    letters += static_cast<char>(is_wide ? static_cast<const mat_uint16_t*>(text->data)[i]
                                         : static_cast<const mat_uint8_t*>(text->data)[i]);
  }
  return letters;
}

class MatArrays : public ArraySource {
 public:
  explicit MatArrays(const std::string& path) : file_(Mat_Open(path.c_str(), MAT_ACC_RDONLY)) {
    if (file_ == nullptr) throw ArrayRefusal("no file of Matlab 5 or later");
  }

  StoredFile Content() override {
    StoredFile content;
    bool has_options = false;
    for (int i = 0; i < kMostVariables; ++i) {
      const matvar_t* const variable = Mat_VarReadNextInfo(file_);
      if (variable == nullptr) break;
      if (variable->name == nullptr || variable->rank < 0 || variable->rank > kMostAxes) continue;
      StoredArray array;
      array.name = variable->name;
      array.size.assign(variable->dims, variable->dims + variable->rank);
      array.number = NumberOfClass(*variable);
      array.type = WordsOfClass(*variable);
      has_options = has_options || array.name == "DecodeOptions";
      content.arrays.push_back(array);
    }
    if (has_options) ReadTasks(&content);
    return content;
  }

  void Read(const std::string& name, const PutBytes& put) override {
    Mat_Rewind(file_);
    matvar_t* const variable = Mat_VarReadInfo(file_, name.c_str());
    if (variable == nullptr) throw ArrayRefusal(name + " is not in it");
    const std::size_t each = BytesOf(NumberOfClass(*variable));
    std::size_t bytes = each;
    for (int i = 0; i < variable->rank; ++i) {
      const std::size_t count = variable->dims[i];
      if (count > 0 && bytes > std::numeric_limits<std::size_t>::max() / count)
        throw ArrayRefusal(name + " is too large");
      bytes *= count;
    }
    if (each == 0 || Mat_VarReadDataAll(file_, variable) != 0 || variable->data == nullptr ||
        variable->nbytes != bytes) {
      throw ArrayRefusal("the numbers of " + name + " cannot be read");
    }
    put(variable->data, bytes);
  }

 private:
  void ReadTasks(StoredFile* content) {
    Mat_Rewind(file_);
    matvar_t* const options = Mat_VarRead(file_, "DecodeOptions");
    if (options == nullptr || options->class_type != MAT_C_STRUCT) return;
    matvar_t* const tasks = Mat_VarGetStructFieldByName(options, "OptionalTasks", 0);
    if (tasks == nullptr) return;
    content->tasks.emplace();
    if (tasks->class_type == MAT_C_CHAR) content->tasks->push_back(TextOf(tasks));
    if (tasks->class_type != MAT_C_CELL || tasks->data == nullptr) return;
    std::size_t count = 1;
    for (int i = 0; i < tasks->rank; ++i) count *= tasks->dims[i];
    for (std::size_t i = 0; i < count && i < kMostTasks; ++i)
      content->tasks->push_back(TextOf(static_cast<matvar_t* const*>(tasks->data)[i]));
  }

  mat_t* file_ = nullptr;
};

}  // namespace

ArraySource* OpenMatArrays(const std::string& path) {
  if (H5Fis_hdf5(path.c_str()) > 0) return OpenHdfArrays(path);
  return new MatArrays(path);
}

}  // namespace thicklens::io
