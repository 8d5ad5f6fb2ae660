#ifndef THICKLENS_IO_READINGS_H_
#define THICKLENS_IO_READINGS_H_

#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/readings.h"

namespace thicklens::io {

// Reads the readings of a sweep from any source: a table of text (model::ReadingsOfTable), a JSON
// file (Micro-Manager's metadata.txt, the frame metadata of pymmcore-plus, a list of objects), a
// companion file of OME-XML, the names of the files, their metadata, or a JSON file beside each.
// `table` is empty if `options` states that the readings come from the files themselves. Throws
// Error that names the place, the value and what would be right. It is a model::ReadingReader.
THICKLENS_EXPORT model::ReadingSet ReadReadings(const std::string& table,
                                                const std::vector<std::string>& files,
                                                const model::ReadingOptions& options);

// The reading of one page of an OME-TIFF.
struct PageReading {
  std::string file;  // that the XML names; empty: the file that contains the XML
  int page = 0;      // from 0, in the order of the file
  int channel = 0, time = 0, slice = 0;  // from 0
  double reading_mm = 0;
};

// The readings of all pages.
struct PageReadings {
  std::vector<PageReading> pages;  // in the order of files and pages
  std::string description;         // "PositionZ, um"
};

// Reads PositionZ of the planes or, if there is none, PhysicalSizeZ times the number of the slice.
// `xml` is the ImageDescription of a page or the content of a companion file, and `place` the path
// for messages. Throws Error.
THICKLENS_EXPORT PageReadings ReadingsOfOmeXml(const std::string& xml, const std::string& place,
                                               const model::ReadingOptions& options);

// Reads the readings of the pages of one file from the OME-XML in its first page, `description`.
// Rows are named "stack.tif[3]". Throws Error.
THICKLENS_EXPORT model::ReadingSet ReadingsOfPages(const std::string& description,
                                                   const std::string& path,
                                                   const model::ReadingOptions& options);

}  // namespace thicklens::io

#endif  // THICKLENS_IO_READINGS_H_
