#ifndef THICKLENS_TOOLS_IO_TABLES_READING_SOURCES_H_
#define THICKLENS_TOOLS_IO_TABLES_READING_SOURCES_H_

#include <string>
#include <vector>

#include "thicklens/model/readings.h"

// One function per kind of source. Each throws Error that names the place.
namespace thicklens::io {

// `text` is the content of the JSON file `path`, which has the readings of all images.
model::ReadingSet ReadingsOfJson(const std::string& text, const std::string& path,
                                 const model::ReadingOptions& options);
// A JSON file beside each image, with the same name and the ending .json.
model::ReadingSet ReadingsOfSidecars(const std::vector<std::string>& files,
                                     const model::ReadingOptions& options);
// EXIF and XMP inside of each image.
model::ReadingSet ReadingsOfExif(const std::vector<std::string>& files,
                                 const model::ReadingOptions& options);
// The OME-XML inside of each image, which has one page.
model::ReadingSet ReadingsOfOmeFiles(const std::vector<std::string>& files,
                                     const model::ReadingOptions& options);
// `xml` is the content of the companion file `path`.
model::ReadingSet ReadingsOfOmeCompanion(const std::string& xml, const std::string& path,
                                         const model::ReadingOptions& options);

// Describes the rows: the name of the value, its unit and the number of images. Throws Error if the
// value is the same in all images, which no reading of a sweep is. A notice says that a focus
// distance is not the position of a bench.
void FinishMetadata(const std::string& what, const std::string& stated_unit, bool is_focus_distance,
                    const model::ReadingOptions& options, model::ReadingSet* set);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_TABLES_READING_SOURCES_H_
