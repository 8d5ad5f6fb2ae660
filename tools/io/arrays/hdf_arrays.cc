// Arrays in the root of an HDF5 file, by libhdf5. MAT 7.3 files are such files: what they hold is
// read by the types of HDF5, because libmatio refuses files whose attribute MATLAB_class h5py
// wrote.
#include <hdf5.h>

#include <algorithm>
#include <array>
#include <memory>
#include <new>

#include "tools/io/arrays/arrays.h"

namespace thicklens::io {
namespace {

// More objects in the root of a file are not looked at.
constexpr hsize_t kMaxObjects = 1000;
constexpr hsize_t kMaxTasks = 100;
constexpr hsize_t kMaxLetters = 200;

// The reason that libhdf5 gives last: that of the function in which it began.
herr_t InnermostReason(unsigned, const H5E_error2_t* error, void* text) {
  if (error->desc != nullptr) *static_cast<std::string*>(text) = error->desc;
  return 0;
}

[[noreturn]] void Refuse(const std::string& what) {
  std::string reason;
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, InnermostReason, &reason);
  throw ArrayRefusal(reason.empty() ? what : what + ": " + reason);
}

hid_t Require(hid_t id, const std::string& what) {
  if (id < 0) Refuse(what);
  return id;
}

StoredNumber NumberOf(hid_t type) {
  const std::size_t bytes = H5Tget_size(type);
  const H5T_class_t kind = H5Tget_class(type);
  if (kind == H5T_FLOAT) {
    return bytes == 4   ? StoredNumber::kFloat
           : bytes == 8 ? StoredNumber::kDouble
                        : StoredNumber::kOther;
  }
  if (kind != H5T_INTEGER || H5Tget_sign(type) != H5T_SGN_NONE) return StoredNumber::kOther;
  return bytes == 1   ? StoredNumber::kUint8
         : bytes == 2 ? StoredNumber::kUint16
                      : StoredNumber::kOther;
}

std::string WordsOf(hid_t type) {
  const std::string bits = std::to_string(8 * H5Tget_size(type)) + "-bit ";
  const H5T_class_t kind = H5Tget_class(type);
  if (kind == H5T_FLOAT) return bits + "floats";
  if (kind != H5T_INTEGER) return "no numbers";
  return (H5Tget_sign(type) == H5T_SGN_NONE ? "unsigned " : "signed ") + bits + "integers";
}

hid_t InMemory(StoredNumber number) {
  switch (number) {
    case StoredNumber::kUint8:
      return H5T_NATIVE_UINT8;
    case StoredNumber::kUint16:
      return H5T_NATIVE_UINT16;
    case StoredNumber::kFloat:
      return H5T_NATIVE_FLOAT;
    default:
      return H5T_NATIVE_DOUBLE;
  }
}

// Numbers in other files, to which a file may refer, are not read: nobody chose those files. Even
// the size of such a data set may be found only in the other file, which is then opened.
bool AreNumbersInTheFile(hid_t data_set) {
  const hid_t creation = Require(H5Dget_create_plist(data_set), "a data set");
  const H5D_layout_t layout = H5Pget_layout(creation);
  return layout == H5D_COMPACT || layout == H5D_CHUNKED ||
         (layout == H5D_CONTIGUOUS && H5Pget_external_count(creation) == 0);
}

void RequireNumbersInTheFile(hid_t data_set, const std::string& name) {
  if (!AreNumbersInTheFile(data_set)) throw ArrayRefusal(name + ": its numbers are in other files");
}

// The number of elements of a data set; 0 if it is not known.
hsize_t CountOf(hid_t data_set) {
  const hid_t space = H5Dget_space(data_set);
  const hssize_t count = space < 0 ? 0 : H5Sget_simple_extent_npoints(space);
  return count < 0 ? 0 : static_cast<hsize_t>(count);
}

// Text of Matlab: integers of 16 bits.
std::string TextOfSet(hid_t data_set) {
  if (!AreNumbersInTheFile(data_set)) return "";
  const hsize_t count = CountOf(data_set);
  if (count > kMaxLetters || H5Tget_class(H5Dget_type(data_set)) != H5T_INTEGER) return "";
  std::array<std::uint16_t, kMaxLetters> letters{};
  if (H5Dread(data_set, H5T_NATIVE_UINT16, H5S_ALL, H5S_ALL, H5P_DEFAULT, letters.data()) < 0)
    return "";
  std::string text;
  for (hsize_t i = 0; i < count; ++i) text += static_cast<char>(letters[i]);
  return text;
}

class HdfArrays : public ArraySource {
 public:
  explicit HdfArrays(const std::string& path) {
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
    // A file may name a filter that libhdf5 would look for in a folder of libraries.
    H5PLset_loading_state(0);
    const hid_t access = Require(H5Pcreate(H5P_FILE_ACCESS), "a property");
    // Files on a network may have no locks, and nothing is written.
    H5Pset_file_locking(access, false, true);
    file_ = Require(H5Fopen(path.c_str(), H5F_ACC_RDONLY, access), "no HDF5 file");
  }

  StoredFile Content() override {
    StoredFile content;
    H5G_info_t group{};
    if (H5Gget_info(file_, &group) < 0) Refuse("the root");
    for (hsize_t i = 0; i < std::min(group.nlinks, kMaxObjects); ++i) {
      std::array<char, 256> name{};
      H5L_info_t link{};
      const bool is_here = H5Lget_name_by_idx(file_, ".", H5_INDEX_NAME, H5_ITER_INC, i,
                                              name.data(), name.size(), H5P_DEFAULT) > 0 &&
                           H5Lget_info(file_, name.data(), &link, H5P_DEFAULT) >= 0 &&
                           link.type == H5L_TYPE_HARD;
      if (is_here) AddArray(name.data(), &content);
    }
    AddNumbers(file_, &content);
    AddTasks(&content);
    return content;
  }

  void Read(const std::string& name, const PutBytes& put) override {
    const hid_t data_set = Require(H5Dopen2(file_, name.c_str(), H5P_DEFAULT), name);
    RequireNumbersInTheFile(data_set, name);
    const hid_t space = Require(H5Dget_space(data_set), name);
    const StoredNumber number = NumberOf(Require(H5Dget_type(data_set), name));
    const auto count = static_cast<std::size_t>(H5Sget_simple_extent_npoints(space));
    const std::size_t bytes = count * BytesOf(number);
    // Numbers that were never written have no bytes in the file.
    constexpr std::size_t kMaxOfAByte = 1032;
    const hsize_t stored = H5Dget_storage_size(data_set);
    if (bytes / kMaxOfAByte > stored || stored == 0) {
      throw ArrayRefusal(name + ": the " + std::to_string(bytes) + " bytes of its numbers are " +
                         std::to_string(stored) + " bytes in the file");
    }
    const auto values = std::make_unique<unsigned char[]>(bytes);
    if (H5Dread(data_set, InMemory(number), H5S_ALL, H5S_ALL, H5P_DEFAULT, values.get()) < 0)
      Refuse(name);
    put(values.get(), bytes);
  }

 private:
  void AddArray(const std::string& name, StoredFile* content) {
    const hid_t data_set = H5Dopen2(file_, name.c_str(), H5P_DEFAULT);
    StoredArray array;
    array.name = name;
    if (data_set < 0) {
      array.type = "a group";
      content->arrays.push_back(array);
      return;
    }
    if (!AreNumbersInTheFile(data_set)) {
      array.type = "numbers in other files";
      content->arrays.push_back(array);
      return;
    }
    const hid_t space = Require(H5Dget_space(data_set), name);
    const int rank = H5Sget_simple_extent_ndims(space);
    std::array<hsize_t, H5S_MAX_RANK> size{};
    if (rank < 0 || rank > H5S_MAX_RANK ||
        H5Sget_simple_extent_dims(space, size.data(), nullptr) != rank) {
      Refuse(name);
    }
    array.size.assign(size.begin(), size.begin() + rank);
    std::reverse(array.size.begin(), array.size.end());
    const hid_t type = Require(H5Dget_type(data_set), name);
    array.number = NumberOf(type);
    array.type = WordsOf(type);
    content->arrays.push_back(array);
    if (name == "LF") AddNumbers(data_set, content);
  }

  // The attributes that are one number each.
  static void AddNumbers(hid_t object, StoredFile* content) {
    H5O_info_t info{};
    if (H5Oget_info2(object, &info, H5O_INFO_NUM_ATTRS) < 0) return;
    for (hsize_t i = 0; i < std::min(info.num_attrs, kMaxObjects); ++i) {
      const hid_t attribute =
          H5Aopen_by_idx(object, ".", H5_INDEX_NAME, H5_ITER_INC, i, H5P_DEFAULT, H5P_DEFAULT);
      std::array<char, 256> name{};
      if (attribute < 0 || H5Aget_name(attribute, name.size(), name.data()) < 0) continue;
      const H5T_class_t kind = H5Tget_class(Require(H5Aget_type(attribute), name.data()));
      const hid_t space = Require(H5Aget_space(attribute), name.data());
      double value = 0;
      if ((kind == H5T_INTEGER || kind == H5T_FLOAT) && H5Sget_simple_extent_npoints(space) == 1 &&
          H5Aread(attribute, H5T_NATIVE_DOUBLE, &value) >= 0) {
        content->numbers.emplace_back(name.data(), value);
      }
    }
  }

  // The cells of DecodeOptions.OptionalTasks are references to data sets of text. An empty cell has
  // the attribute MATLAB_empty, and its size as numbers.
  void AddTasks(StoredFile* content) {
    constexpr char kOptions[] = "DecodeOptions";
    constexpr char kTasks[] = "DecodeOptions/OptionalTasks";
    H5L_info_t link{};
    if (H5Lexists(file_, kOptions, H5P_DEFAULT) <= 0 ||
        H5Lget_info(file_, kOptions, &link, H5P_DEFAULT) < 0 || link.type != H5L_TYPE_HARD ||
        H5Lexists(file_, kTasks, H5P_DEFAULT) <= 0 ||
        H5Lget_info(file_, kTasks, &link, H5P_DEFAULT) < 0 || link.type != H5L_TYPE_HARD) {
      return;
    }
    const hid_t tasks = H5Dopen2(file_, kTasks, H5P_DEFAULT);
    if (tasks < 0) return;
    RequireNumbersInTheFile(tasks, kTasks);
    content->tasks.emplace();
    if (H5Aexists(tasks, "MATLAB_empty") > 0) return;
    if (H5Tget_class(H5Dget_type(tasks)) != H5T_REFERENCE) {
      content->tasks->push_back(TextOfSet(tasks));
      return;
    }
    std::array<hobj_ref_t, kMaxTasks> references{};
    const hsize_t count = CountOf(tasks);
    if (count > kMaxTasks ||
        H5Dread(tasks, H5T_STD_REF_OBJ, H5S_ALL, H5S_ALL, H5P_DEFAULT, references.data()) < 0) {
      Refuse(kTasks);
    }
    for (hsize_t i = 0; i < count; ++i) {
      const hid_t text = H5Rdereference2(tasks, H5P_DEFAULT, H5R_OBJECT, &references[i]);
      if (text >= 0 && H5Iget_type(text) == H5I_DATASET) content->tasks->push_back(TextOfSet(text));
    }
  }

  hid_t file_ = H5I_INVALID_HID;
};

}  // namespace

ArraySource* OpenHdfArrays(const std::string& path) { return new HdfArrays(path); }

void PrepareHdf() {
  // Nothing else: the program may use libhdf5 itself, and its settings stay.
  H5open();
}

}  // namespace thicklens::io
