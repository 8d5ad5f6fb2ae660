#ifndef THICKLENS_TOOLS_IO_LIGHTFIELDS_LAYOUT_H_
#define THICKLENS_TOOLS_IO_LIGHTFIELDS_LAYOUT_H_

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/io/light_field_io.h"
#include "thicklens/model/light_field.h"

namespace thicklens::io {

// A light field without its values, and how to read them.
struct ViewSource {
  // Size and channels may be 0: they are then those of the first view.
  model::LightField frame;
  // Reads the view (k, l) of the frame in linear light; called from several threads.
  std::function<model::LinearImage(int k, int l)> read;
  // Our own layout states which views there are, and in which order: nothing is examined.
  bool is_own = false;
  bool is_plain = false;             // see LightFieldFacts
  std::string kind;                  // "a Stanford folder"
  std::vector<std::string> details;  // clauses for the line that says what was read
  std::vector<std::string> notices;  // sentences
  std::string mirrored;              // a clause: which direction files of this layout mirror
  // The disparity that views of neighbouring pixels of a plain image have, px; 0: there are none.
  double plain_disparity_px = 0;
  // Another reading of the same numbers, if the shifts between the views have to decide: views that
  // are counted from 1 and not from 0.
  std::shared_ptr<const ViewSource> from_one;
  std::string doubt;  // a clause: what speaks against the stated numbers of views; empty: nothing
};

// A file or a folder that may be a light field.
struct LayoutInput {
  std::string path;
  bool is_folder = false;
  // The option layout names this layout: what does not fit is an error.
  bool is_forced = false;
  const LightFieldReading* reading = nullptr;
};

// A layout of light fields. A new one is a file of this folder with one function, a line in
// light_field_reader.cc, and a test.
struct ViewLayout {
  const char* name;   // in the option layout
  const char* marks;  // how it is recognised, for messages
  bool is_of_folders;
  // Returns nothing if the input has another layout. Throws Error that names the folder and the
  // file if the input has this layout but cannot be read.
  std::optional<ViewSource> (*open)(const LayoutInput& input);
};

std::optional<ViewSource> OpenOwnFolder(const LayoutInput& input);
std::optional<ViewSource> OpenHciFolder(const LayoutInput& input);
std::optional<ViewSource> OpenStanfordFolder(const LayoutInput& input);
std::optional<ViewSource> OpenNamedFolder(const LayoutInput& input);
std::optional<ViewSource> OpenQuilt(const LayoutInput& input);
std::optional<ViewSource> OpenLensletImage(const LayoutInput& input);
std::optional<ViewSource> OpenTiledImage(const LayoutInput& input);
std::optional<ViewSource> OpenImageParts(const LayoutInput& input);
std::optional<ViewSource> OpenMatFile(const LayoutInput& input);
std::optional<ViewSource> OpenHdf5File(const LayoutInput& input);

// Whether the name of a file is that of a quilt, or of an image of lenslets.
bool IsNamedQuilt(const std::string& path);
bool IsNamedEslf(const std::string& path);
// Whether it is a MAT or HDF5 file, which no other reader can read.
bool IsFileOfArrays(const std::string& path);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_LIGHTFIELDS_LAYOUT_H_
