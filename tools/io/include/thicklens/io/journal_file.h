#ifndef THICKLENS_IO_JOURNAL_FILE_H_
#define THICKLENS_IO_JOURNAL_FILE_H_

#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/base/temporaries.h"

namespace thicklens::io {

// A file that grows record by record during a long run, and that another run reads again. A record
// is present as a whole or not at all: each has its SHA-256. Damaged records are left out, and so
// is an incomplete record at the end, which a killed run or a full disk leaves. Only one run holds
// the file at a time.
//
// Format: a first line that states the kind of file; then for each record a line "record BYTES
// SHA256", its bytes, and a newline.
class THICKLENS_EXPORT JournalFile {
 public:
  // Opens the file or creates it. `stop` is called from time to time and may throw. Throws Error if
  // the file is of another kind, damaged from its beginning, held by another run, or cannot be
  // opened.
  JournalFile(std::string path, const std::string& kind, const std::function<void()>& stop = {});
  ~JournalFile();  // a file without any record is removed
  JournalFile(const JournalFile&) = delete;
  JournalFile& operator=(const JournalFile&) = delete;

  // The path as given to the constructor.
  const std::string& path() const { return path_; }
  std::size_t size() const;  // number of records
  // Number of bytes that were left out when the file was opened.
  std::uint64_t bytes_left_out() const { return bytes_left_out_; }
  // Reads a record, or at most its first `most_bytes` bytes. May be called from any thread. Read
  // and Append throw Error if the disk fails.
  std::string Read(std::size_t record, std::size_t most_bytes = SIZE_MAX) const;
  // Appends all records in one step: the file then has all of them or, unless the disk fails, none.
  // Throws Interrupted for the first records of a file that is being removed because the process
  // ends.
  void Append(const std::vector<std::string>& records);
  // Removes all records.
  void Clear();
  // Removes the file when it is no longer needed. Returns whether it could be removed.
  bool Remove();

 private:
  struct Place {
    std::uint64_t offset = 0;
    std::size_t bytes = 0;
  };

  enum class Found { kWhole, kDamaged, kNone };

  void Open();
  void ReadRecords(const std::function<void()>& stop);
  // Finds the record that begins there. There is none if it does not fit into the file or nothing
  // marks its beginning.
  Found FindRecord(std::uint64_t offset, std::uint64_t file_bytes, Place* place) const;
  std::string ReadAt(std::uint64_t offset, std::size_t bytes) const;
  void WriteAt(std::uint64_t offset, const std::string& bytes) const;

  std::string path_, first_line_;
  std::string followed_;  // the file that the path leads to
  int file_ = -1;
  mutable std::mutex mutex_;  // guards records_ and end_
  std::vector<Place> records_;
  Temporary without_record_;  // the file, until it has a record
  std::uint64_t end_ = 0;     // end of the last record
  std::uint64_t bytes_left_out_ = 0;
};

}  // namespace thicklens::io

#endif  // THICKLENS_IO_JOURNAL_FILE_H_
