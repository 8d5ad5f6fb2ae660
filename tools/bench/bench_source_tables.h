#ifndef THICKLENS_TOOLS_BENCH_BENCH_SOURCE_TABLES_H_
#define THICKLENS_TOOLS_BENCH_BENCH_SOURCE_TABLES_H_

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "thicklens/kernels/device.h"
#include "tools/bench/bench_parts.h"
#include "tools/bench/bench_source_rows.h"

namespace thicklens::tools {

// An image with one number of views.
struct SourceImage : SampledImage {
  std::string name;
  char size = ' ';  // the paper's size 'K' or 'L'
  int views = 0;
};

// Cuts as CutParts does, with fewer parts for many views, and names the size.
void Cut(bool full, SourceImage* image);

// A row to be measured. `run` runs it once and returns the seconds that this took, or would take
// for the whole image. The first run also fills in the other fields of the row.
struct SourceContender {
  SourceRow row;
  std::function<double(SourceRow* row)> run;
};

// Data that the tables share.
struct SourceBench {
  int threads = 1;
  double triad_bytes_per_second = 0;
  std::shared_ptr<kernels::Backend> processor, device;  // device: null where there is none
};

// Appends the rows of one of the paper's tables. The rows keep references to `bench` and `image`.
void AddTable1(const SourceBench& bench, const SourceImage& image,
               std::vector<SourceContender>* contenders);
void AddTable2(const SourceBench& bench, const SourceImage& image,
               std::vector<SourceContender>* contenders);
void AddTable3(const SourceBench& bench, const SourceImage& image,
               std::vector<SourceContender>* contenders);
// Compares the image's lens with its thin counterpart.
void AddTable4(const SourceBench& bench, const SourceImage& image,
               std::vector<SourceContender>* contenders);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_BENCH_SOURCE_TABLES_H_
