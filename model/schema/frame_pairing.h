#ifndef THICKLENS_MODEL_SCHEMA_FRAME_PAIRING_H_
#define THICKLENS_MODEL_SCHEMA_FRAME_PAIRING_H_

#include <map>
#include <string>
#include <vector>

#include "thicklens/model/readings.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::model {

// Pairs the rows of `readings` with the images `files` of the folder. A row names its image by an
// absolute path, by a path relative to the table's folder or to `folder`, or by its name alone if
// only one image has it. Throws Error with the place for a row or an image without its partner.
std::vector<SweepFrame> PairFrames(const ReadingSet& readings,
                                   const std::vector<std::string>& files, const std::string& folder,
                                   std::vector<std::string>* notices);

// Returns the image of each row, a normal path; empty for a row whose image is not among `files`.
std::vector<std::string> ImagesOfRows(const ReadingSet& readings,
                                      const std::vector<std::string>& files,
                                      const std::string& folder);

// Pairs the rows with the pages of one file: "stack.tif[3]" counts them from 0, and numbers alone
// count from 0 or from 1. Throws Error with the place for a row or a page without its partner.
std::vector<SweepFrame> PairPages(const ReadingSet& readings, const std::string& path, int pages);

// Returns the row of each frame of a video that has one; `path` has `frames` of them. Rows are as
// for PairPages, but they need not be complete: without a 0 they count from 1 only if one of them
// is the number of all frames. Throws Error with the place for a row without its frame.
std::map<int, const FileReading*> RowsOfFrames(const ReadingSet& readings, const std::string& path,
                                               int frames, std::vector<std::string>* notices);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SCHEMA_FRAME_PAIRING_H_
