#ifndef THICKLENS_TOOLS_JOURNAL_FILE_H_
#define THICKLENS_TOOLS_JOURNAL_FILE_H_

#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "thicklens/base/temporaries.h"

namespace thicklens::tools {

// A file that grows record by record while a long run is on its way, and that another run reads
// again. A record is there whole or not at all: each carries its SHA-256. One that is damaged is
// left out, and so is what a killed run, or one whose disk was full, had begun to write at the end.
// One run holds the file at a time.
//
// A first line, which says what kind of file it is; then for each record a line "record BYTES
// SHA256", its bytes, and a newline.
class JournalFile {
 public:
  // Opens the file, or makes a new one. `stop` is called now and then and may throw. Throws Error:
  // no file of this kind, damaged from its beginning, held by another run, not to be opened.
  JournalFile(std::string path, const std::string& kind, const std::function<void()>& stop = {});
  ~JournalFile();  // a file without any record is removed
  JournalFile(const JournalFile&) = delete;
  JournalFile& operator=(const JournalFile&) = delete;

  const std::string& path() const { return path_; }
  std::size_t size() const;  // records
  // When it was opened.
  std::uint64_t bytes_left_out() const { return bytes_left_out_; }
  // From any thread. Throw Error for what the disk does not do. No more than the first bytes, where
  // their number is given.
  std::string Read(std::size_t record, std::size_t most_bytes = SIZE_MAX) const;
  // All of them in one go: the file has none of them or, but for a disk that fails, all. Throws
  // Interrupted for the first ones of a file that is being removed because the process ends.
  void Append(const std::vector<std::string>& records);
  // Begins anew, without records.
  void Clear();
  // The file has served its purpose. Whether it could be removed.
  bool Remove();

 private:
  struct Place {
    std::uint64_t offset = 0;
    std::size_t bytes = 0;
  };

  enum class Found { kWhole, kDamaged, kNone };

  void Open();
  void ReadRecords(const std::function<void()>& stop);
  // The record that begins there; none, if there is no room for it or nothing says that one begins.
  Found FindRecord(std::uint64_t offset, std::uint64_t file_bytes, Place* place) const;
  std::string ReadAt(std::uint64_t offset, std::size_t bytes) const;
  void WriteAt(std::uint64_t offset, const std::string& bytes) const;

  std::string path_, first_line_;
  std::string followed_;  // what the path leads to
  int file_ = -1;
  mutable std::mutex mutex_;  // of the two that grow
  std::vector<Place> records_;
  Temporary without_record_;  // the file, as long as there is none
  std::uint64_t end_ = 0;     // of the last record
  std::uint64_t bytes_left_out_ = 0;
};

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_JOURNAL_FILE_H_
