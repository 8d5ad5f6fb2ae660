#ifndef THICKLENS_TOOLS_BENCH_SOURCE_TABLES_H_
#define THICKLENS_TOOLS_BENCH_SOURCE_TABLES_H_

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "bench_parts.h"
#include "bench_source_rows.h"
#include "thicklens/kernels/device.h"

namespace thicklens::tools {

// A picture of one number of views.
struct SourcePicture : SampledPicture {
  std::string name;
  char size = ' ';  // 'K' or 'L' of the source
  int views = 0;
};

// As CutParts, fewer of many views, and the name of the size.
void Cut(bool full, SourcePicture* picture);

// A row to be measured: runs once and says how many seconds that took, or would take for the
// whole picture. The first run fills in what the row tells beside.
struct SourceContender {
  SourceRow row;
  std::function<double(SourceRow* row)> run;
};

// Everything that the tables share.
struct SourceBench {
  int threads = 1;
  double triad_bytes_per_second = 0;
  std::shared_ptr<kernels::Backend> processor, device;  // device: null where there is none
};

// Appends the rows of one of the source's tables. They keep `bench` and `picture`.
void AddTable1(const SourceBench& bench, const SourcePicture& picture,
               std::vector<SourceContender>* contenders);
void AddTable2(const SourceBench& bench, const SourcePicture& picture,
               std::vector<SourceContender>* contenders);
void AddTable3(const SourceBench& bench, const SourcePicture& picture,
               std::vector<SourceContender>* contenders);
// The picture's lens against its thin twin.
void AddTable4(const SourceBench& bench, const SourcePicture& picture,
               std::vector<SourceContender>* contenders);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_SOURCE_TABLES_H_
