#include "thicklens/io/journal_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "thicklens/io/data_hash.h"

namespace thicklens::io {
namespace {

constexpr char kWord[] = "record ";
constexpr std::size_t kHashDigits = 64;
// "record ", a number of up to 20 digits, a space, the hash, a newline.
constexpr std::size_t kLongestLine = sizeof(kWord) - 1 + 20 + 1 + kHashDigits + 1;

Error Failure(const std::string& path, const std::string& what, int error) {
  return Error(fmt::format("{}: {}: {}", path, what, std::strerror(error)));
}

Error NoRegularFile(const std::string& path, const struct stat& info) {
  return Error(fmt::format("{}: is not a regular file but {}; name another", path,
                           KindOfFile(info.st_mode)));
}

bool IsTaken(int error) { return error == EEXIST || error == ENOENT || error == ELOOP; }

// Returns the file that a path leads to, which may not exist yet. A journal may be a link to
// another disk; the link stays when the file is removed.
std::string FollowedPath(const std::string& path) {
  std::error_code failure;
  const auto followed = std::filesystem::canonical(path, failure);
  if (!failure) return followed.string();
  std::error_code no_link;
  const auto target = std::filesystem::read_symlink(path, no_link);
  if (no_link || failure != std::errc::no_such_file_or_directory) return path;
  return (std::filesystem::path(path).parent_path() / target).string();
}

// An existing file is checked before it is opened; a new one is created only if nothing is there.
// No link is followed except the given path. Returns -1 if the file was created or removed in
// between.
int OpenOrMake(const std::string& path) {
  constexpr int kAlways = O_RDWR | O_CLOEXEC | O_NONBLOCK | O_NOFOLLOW;
  constexpr char kWhat[] = "cannot be opened; name a file in a folder that can be written to";
  const std::string followed = FollowedPath(path);
  struct stat info {};
  const bool is_there = ::lstat(followed.c_str(), &info) == 0;
  if (!is_there && errno != ENOENT) throw Failure(path, kWhat, errno);
  if (!is_there) {
    const int made = ::open(followed.c_str(), kAlways | O_CREAT | O_EXCL, 0666);
    if (made < 0 && errno != EEXIST) throw Failure(path, kWhat, errno);
    return made;
  }
  if (!S_ISREG(info.st_mode)) throw NoRegularFile(path, info);
  const int opened = ::open(followed.c_str(), kAlways);
  if (opened < 0 && !IsTaken(errno)) throw Failure(path, kWhat, errno);
  if (opened < 0 || (::fstat(opened, &info) == 0 && S_ISREG(info.st_mode))) return opened;
  ::close(opened);
  throw NoRegularFile(path, info);
}

bool IsNamed(int file, const std::string& path) {
  struct stat opened {
  }, named{};
  return ::fstat(file, &opened) == 0 && ::stat(path.c_str(), &named) == 0 &&
         opened.st_ino == named.st_ino && opened.st_dev == named.st_dev;
}

}  // namespace

JournalFile::JournalFile(std::string path, const std::string& kind,
                         const std::function<void()>& stop)
    : path_(std::move(path)), first_line_(kind + "\n") {
  try {
    Open();
    ReadRecords(stop);
    if (records_.empty()) without_record_ = Temporary([this] { return followed_; });
  } catch (...) {
    if (file_ >= 0) ::close(file_);
    throw;
  }
}

JournalFile::~JournalFile() {
  if (file_ < 0) return;
  if (records_.empty()) Remove();
  ::close(file_);
}

void JournalFile::Open() {
  if (path_ == "-") {
    throw Error("-: the checkpoint cannot be written to standard output; name a file");
  }
  constexpr int kMaxTries = 100;
  for (int i = 0; i < kMaxTries; ++i) {
    file_ = OpenOrMake(path_);
    if (file_ < 0) continue;
    if (::flock(file_, LOCK_EX | LOCK_NB) != 0) {
      if (errno != EWOULDBLOCK) throw Failure(path_, "cannot be locked", errno);
      throw Error(
          fmt::format("{}: another run is using it; wait for it or name another file", path_));
    }
    // The run that held the lock may have removed the file in between. The identity counts, not the
    // link, which is kept.
    std::error_code failure;
    followed_ = std::filesystem::canonical(path_, failure).string();
    if (!failure && IsNamed(file_, followed_)) return;
    ::close(std::exchange(file_, -1));
  }
  throw Error(fmt::format("{}: cannot be opened: it is repeatedly removed", path_));
}

void JournalFile::ReadRecords(const std::function<void()>& stop) {
  struct stat info {};
  if (::fstat(file_, &info) != 0) throw Failure(path_, "cannot be read", errno);
  const auto file_bytes = static_cast<std::uint64_t>(info.st_size);
  const std::string begin =
      ReadAt(0, static_cast<std::size_t>(std::min<std::uint64_t>(first_line_.size(), file_bytes)));
  if (first_line_.compare(0, begin.size(), begin) != 0) {
    throw Error(
        fmt::format("{}: is another kind of file (its first line must be '{}') and would be "
                    "overwritten; name another file",
                    path_, first_line_.substr(0, first_line_.size() - 1)));
  }
  if (begin.size() == first_line_.size()) {
    end_ = first_line_.size();
    Place place;
    for (Found found; (found = FindRecord(end_, file_bytes, &place)) != Found::kNone;) {
      const std::uint64_t next = place.offset + place.bytes + 1;
      if (found == Found::kWhole) records_.push_back(place);
      if (found == Found::kDamaged) bytes_left_out_ += next - end_;
      end_ = next;
      if (stop) stop();
    }
  }
  bytes_left_out_ += file_bytes - end_;
  // A run that is killed right after its start leaves at most this many bytes.
  constexpr std::uint64_t kMaxWithoutWorth = 1 << 16;
  if (records_.empty() && bytes_left_out_ > kMaxWithoutWorth) {
    throw Error(fmt::format(
        "{}: is damaged: none of its {} bytes can be read; remove it or name another file", path_,
        file_bytes));
  }
}

JournalFile::Found JournalFile::FindRecord(std::uint64_t offset, std::uint64_t file_bytes,
                                           Place* place) const {
  const std::string line = ReadAt(
      offset, static_cast<std::size_t>(std::min<std::uint64_t>(kLongestLine, file_bytes - offset)));
  const std::size_t length = line.find('\n');
  constexpr std::size_t kWordLength = sizeof(kWord) - 1;
  if (length == std::string::npos || line.compare(0, kWordLength, kWord) != 0) return Found::kNone;
  std::uint64_t bytes = 0;
  const char* end = line.data() + length;
  const auto [read, failure] = std::from_chars(line.data() + kWordLength, end, bytes);
  if (failure != std::errc() || end - read != 1 + static_cast<std::ptrdiff_t>(kHashDigits) ||
      *read != ' ') {
    return Found::kNone;
  }
  const std::uint64_t start = offset + length + 1;
  // The newline after the record must fit as well. This is checked before memory is allocated.
  if (bytes >= file_bytes - start) return Found::kNone;
  *place = {start, static_cast<std::size_t>(bytes)};
  const std::string record = ReadAt(start, place->bytes + 1);
  const bool is_whole =
      record.size() == place->bytes + 1 && record.back() == '\n' &&
      Sha256Hex(std::string_view(record).substr(0, place->bytes)) == std::string(read + 1, end);
  return is_whole ? Found::kWhole : Found::kDamaged;
}

std::string JournalFile::ReadAt(std::uint64_t offset, std::size_t bytes) const {
  std::string found(bytes, '\0');
  std::size_t done = 0;
  while (done < bytes) {
    const ssize_t n =
        ::pread(file_, found.data() + done, bytes - done, static_cast<off_t>(offset + done));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw Failure(path_, "cannot be read", errno);
    if (n == 0) break;  // the file was truncated
    done += static_cast<std::size_t>(n);
  }
  found.resize(done);
  return found;
}

void JournalFile::WriteAt(std::uint64_t offset, const std::string& bytes) const {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t n = ::pwrite(file_, bytes.data() + done, bytes.size() - done,
                               static_cast<off_t>(offset + done));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw Failure(path_, "cannot be written", errno);
    done += static_cast<std::size_t>(n);
  }
}

std::size_t JournalFile::size() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return records_.size();
}

std::string JournalFile::Read(std::size_t record, std::size_t most_bytes) const {
  Place place;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    place = records_.at(record);
  }
  return ReadAt(place.offset, std::min(place.bytes, most_bytes));
}

void JournalFile::Append(const std::vector<std::string>& records) {
  std::string bytes;
  std::vector<Place> places;  // offsets from the first of these bytes
  for (const std::string& record : records) {
    bytes += fmt::format("{}{} {}\n", kWord, record.size(), Sha256Hex(record));
    places.push_back({bytes.size(), record.size()});
    bytes += record + "\n";
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  if (records_.empty()) {
    WriteAt(0, first_line_);
    end_ = first_line_.size();
  }
  // An incomplete record must not remain, and no older bytes may follow the new record.
  if (::ftruncate(file_, static_cast<off_t>(end_)) != 0) {
    throw Failure(path_, "cannot be written", errno);
  }
  WriteAt(end_, bytes);
  if (!without_record_.path().empty()) {
    without_record_.Keep();
    without_record_ = {};
  }
  for (const Place& place : places) records_.push_back({end_ + place.offset, place.bytes});
  end_ += bytes.size();
}

void JournalFile::Clear() {
  const std::lock_guard<std::mutex> lock(mutex_);
  records_.clear();
  without_record_ = Temporary([this] { return followed_; });
}

bool JournalFile::Remove() { return IsNamed(file_, followed_) && ::unlink(followed_.c_str()) == 0; }

}  // namespace thicklens::io
