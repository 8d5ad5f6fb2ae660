#include "tools/io/array_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <fstream>
#include <mutex>
#include <system_error>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/forked_process.h"
#include "thicklens/base/input_file.h"
#include "thicklens/base/memory_available.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/base/stopwatch.h"
#include "tools/io/plugin.h"

namespace thicklens::io {
namespace {

constexpr std::size_t kMaxContentBytes = std::size_t{1} << 20;
constexpr std::size_t kMaxReasonBytes = 4096;
// The process ends after so much time of a processor, s. The largest file of 4 GiB needs a tenth.
constexpr rlim_t kMaxSeconds = 600;
// And it is ended if it sends nothing for so long, s: more than that time of a busy processor.
constexpr int kMaxSilentSeconds = 1800;

const ArrayLibrary& LoadedArrayLibrary() {
  static const ArrayLibrary* const library = [] {
    const auto* const loaded = static_cast<const ArrayLibrary*>(
        LoadPlugin({THICKLENS_ARRAY_LIBRARY, "ThicklensArrayLibrary",
                    "reads the files of Matlab (.mat) and HDF5 files"}));
    loaded->prepare();
    return loaded;
  }();
  return *library;
}

// ---- The messages between both processes: numbers of 8 bytes, and texts after their length.

void PutNumber(std::uint64_t number, std::string* message) {
  message->append(reinterpret_cast<const char*>(&number), sizeof number);
}
void PutText(const std::string& text, std::string* message) {
  PutNumber(text.size(), message);
  *message += text;
}

// Reads a message, whose sender may have been made to write anything.
class MessageReader {
 public:
  MessageReader(const std::string& path, const std::string& message)
      : path_(path), message_(message) {}
  std::uint64_t Number() {
    std::uint64_t number = 0;
    std::memcpy(&number, Next(sizeof number), sizeof number);
    return number;
  }
  double Real() {
    double number = 0;
    std::memcpy(&number, Next(sizeof number), sizeof number);
    return number;
  }
  std::string Text() {
    const std::uint64_t length = Number();
    return {Next(length), static_cast<std::size_t>(length)};
  }

 private:
  const char* Next(std::uint64_t count) {
    if (count > message_.size() - at_) throw Error(path_ + ": its description is damaged");
    at_ += static_cast<std::size_t>(count);
    return message_.data() + at_ - count;
  }

  const std::string& path_;
  const std::string& message_;
  std::size_t at_ = 0;
};

std::string Packed(const StoredFile& content) {
  std::string message;
  PutNumber(content.arrays.size(), &message);
  for (const StoredArray& array : content.arrays) {
    PutText(array.name, &message);
    PutNumber(array.size.size(), &message);
    for (const std::uint64_t count : array.size) PutNumber(count, &message);
    PutNumber(static_cast<std::uint64_t>(array.number), &message);
    PutText(array.type, &message);
  }
  PutNumber(content.numbers.size(), &message);
  for (const auto& [name, value] : content.numbers) {
    PutText(name, &message);
    message.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  PutNumber(content.tasks ? 1 : 0, &message);
  if (!content.tasks) return message;
  PutNumber(content.tasks->size(), &message);
  for (const std::string& task : *content.tasks) PutText(task, &message);
  return message;
}

StoredFile Unpacked(const std::string& path, const std::string& message) {
  MessageReader reader(path, message);
  StoredFile content;
  for (std::uint64_t left = reader.Number(); left > 0; --left) {
    StoredArray array;
    array.name = reader.Text();
    for (std::uint64_t axes = reader.Number(); axes > 0; --axes)
      array.size.push_back(reader.Number());
    const std::uint64_t number = reader.Number();
    if (number <= static_cast<std::uint64_t>(StoredNumber::kDouble))
      array.number = static_cast<StoredNumber>(number);
    array.type = reader.Text();
    content.arrays.push_back(array);
  }
  for (std::uint64_t left = reader.Number(); left > 0; --left) {
    std::string name = reader.Text();
    content.numbers.emplace_back(std::move(name), reader.Real());
  }
  if (reader.Number() == 0) return content;
  content.tasks.emplace();
  for (std::uint64_t left = reader.Number(); left > 0; --left)
    content.tasks->push_back(reader.Text());
  return content;
}

// ---- The process that reads. It has only its own thread, and never returns.

// Sends everything, or ends the process.
void Send(int socket, const void* bytes, std::size_t count) {
  const char* at = static_cast<const char*>(bytes);
  while (count > 0) {
    const ssize_t sent = send(socket, at, count, MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent <= 0) _exit(1);
    at += sent;
    count -= static_cast<std::size_t>(sent);
  }
}

// A message begins with 1, or with 0 if it is the reason of a failure.
void SendMessage(int socket, bool is_good, const std::string& message) {
  std::string text;
  PutNumber(is_good ? 1 : 0, &text);
  PutText(is_good ? message : message.substr(0, kMaxReasonBytes), &text);
  Send(socket, text.data(), text.size());
}

// Data of this process as /proc states it, bytes.
rlim_t DataBytes() {
  std::ifstream file("/proc/self/statm");
  std::array<rlim_t, 6> pages{};
  for (rlim_t& number : pages) file >> number;
  return file ? pages[5] * static_cast<rlim_t>(sysconf(_SC_PAGESIZE)) : 0;
}

void LimitThisProcess(std::optional<double> memory_left_mib) {
  const auto limit = [](auto what, rlim_t most) {
    const rlimit both{most, most};
    setrlimit(what, &both);
  };
  limit(RLIMIT_FSIZE, 0);
  // The signal of the soft limit says what happened; that of the hard one does not.
  const rlimit seconds{kMaxSeconds, kMaxSeconds + 5};
  setrlimit(RLIMIT_CPU, &seconds);
  const rlim_t data = DataBytes();
  if (memory_left_mib && data > 0)
    limit(RLIMIT_DATA, data + static_cast<rlim_t>(*memory_left_mib) * (1 << 20));
}

// noexcept: an exception ends this process here, and never reaches the caller's stack in it.
[[noreturn]] void ReadArraysForever(int socket, const ArrayLibrary& library,
                                    const std::string& path, ArrayFormat format,
                                    std::optional<double> memory_left_mib, pid_t parent) noexcept {
  BeginForkedProcess(parent, {SIGTERM, SIGHUP, SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGXCPU},
                     {SIGINT, SIGQUIT, SIGXFSZ});
  // libhdf5 writes its warnings there.
  const int nowhere = open("/dev/null", O_RDWR | O_CLOEXEC);
  if (nowhere < 0) _exit(1);
  for (const int standard : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) dup2(nowhere, standard);
  LimitThisProcess(memory_left_mib);
  StoredFile content;
  std::string why;
  void* const file = library.open(path, format, &content, &why);
  SendMessage(socket, file != nullptr, file != nullptr ? Packed(content) : why);
  std::uint64_t index = 0;
  if (file == nullptr || recv(socket, &index, sizeof index, MSG_WAITALL) != sizeof index ||
      index >= content.arrays.size()) {
    _exit(0);
  }
  const bool is_read = library.read(
      file, content.arrays[static_cast<std::size_t>(index)].name,
      [socket](const void* bytes, std::size_t count) {
        SendMessage(socket, true, "");
        Send(socket, bytes, count);
      },
      &why);
  if (!is_read) SendMessage(socket, false, why);
  _exit(0);
}

// Another thread may begin such a process at the same time, which would then have this one's end of
// the socket and hide that this process ended.
std::mutex& ForkMutex() {
  static std::mutex mutex;
  return mutex;
}

}  // namespace

std::optional<ArrayFormat> FormatOfArrays(const std::string& path) {
  RequireRegularFile(path);
  std::ifstream file(path, std::ios::binary);
  std::string start(4096, '\0');
  file.read(start.data(), static_cast<std::streamsize>(start.size()));
  start.resize(static_cast<std::size_t>(file.gcount()));
  constexpr char kMat[] = "MATLAB ";
  if (start.rfind(kMat, 0) == 0) return ArrayFormat::kMat;
  // A header of MAT 5 may have any text; its last bytes are the version and the byte order.
  constexpr std::size_t kVersionAt = 124;
  const std::string mark = start.size() > kVersionAt + 3 ? start.substr(kVersionAt, 4) : "";
  using namespace std::string_literals;
  if (mark == "\0\1IM"s || mark == "\1\0MI"s) return ArrayFormat::kMat;
  // The superblock may follow a block of the user, whose length is a power of 2.
  for (std::size_t at = 0; at < start.size(); at = at == 0 ? 512 : 2 * at) {
    if (start.compare(at, 8, "\x89HDF\r\n\x1A\n") == 0) return ArrayFormat::kHdf5;
  }
  return std::nullopt;
}

ArrayFile::ArrayFile(const std::string& path, ArrayFormat format) : path_(path) {
  ReportInput(path);
  RequireRegularFile(path);
  const ArrayLibrary& library = LoadedArrayLibrary();
  const std::optional<double> memory_left_mib = MemoryLeftMib();
  {
    const std::lock_guard<std::mutex> lock(ForkMutex());
    std::array<int, 2> ends{};
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) {
      throw Error(fmt::format("{}: no socket for the process that reads it: {}", path,
                              std::generic_category().message(errno)));
    }
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    const pid_t parent = getpid();
    process_.id = fork();
    if (process_.id == 0) {
      close(ends[0]);
      ReadArraysForever(ends[1], library, path, format, memory_left_mib, parent);
    }
    const int failure = errno;
    pthread_sigmask(SIG_SETMASK, &before, nullptr);
    close(ends[1]);
    process_.socket = ends[0];
    if (process_.id < 0) {
      throw Error(fmt::format("{}: the process that reads it cannot begin: {}", path,
                              std::generic_category().message(failure)));
    }
  }
  content_ = Unpacked(path, Received(kMaxContentBytes));
}

ArrayFile::Process::~Process() {
  if (socket >= 0) close(socket);
  if (id <= 0) return;
  kill(id, SIGKILL);
  StatusAtEnd(id);
}

void ArrayFile::Receive(void* bytes, std::size_t count) {
  char* at = static_cast<char*>(bytes);
  auto last_news = Clock::now();
  while (count > 0) {
    ThrowIfCancelled();
    // A file may make the process wait for something that never comes, which costs no processor.
    if (SecondsSince(last_news) > kMaxSilentSeconds) {
      throw Error(fmt::format("{}: cannot be read: the process that reads it sent nothing for {} s",
                              path_, kMaxSilentSeconds));
    }
    pollfd ready{process_.socket, POLLIN, 0};
    constexpr int kMaxWaitMs = 100;
    if (poll(&ready, 1, kMaxWaitMs) <= 0) continue;
    constexpr std::size_t kMaxAtOnce = std::size_t{1} << 22;
    const ssize_t got = recv(process_.socket, at, std::min(count, kMaxAtOnce), 0);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) ThrowEnded();
    last_news = Clock::now();
    at += got;
    count -= static_cast<std::size_t>(got);
  }
}

std::string ArrayFile::Received(std::size_t most_bytes) {
  std::array<std::uint64_t, 2> head{};  // whether it is good, and its length
  Receive(head.data(), sizeof head);
  const bool is_good = head[0] == 1;
  if (head[1] > (is_good ? most_bytes : kMaxReasonBytes))
    throw Error(fmt::format("{}: its description is damaged, or it has too many arrays", path_));
  std::string message(static_cast<std::size_t>(head[1]), '\0');
  Receive(message.data(), message.size());
  if (!is_good) {
    throw Error(
        fmt::format("{}: cannot be read, it may be damaged: {}", path_, PrintableUtf8(message)));
  }
  return message;
}

void ArrayFile::ThrowEnded() {
  const int status = StatusAtEnd(process_.id);
  process_.id = -1;
  const int number = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
  // An access outside of the memory is a fault that only the file's content can lead to; the system
  // and the limits of memory end a process by other ways.
  const bool is_crash = number == SIGSEGV || number == SIGBUS;
  throw Error(fmt::format(
      "{}: cannot be read{}: the process that reads it {}", path_,
      is_crash ? ", it is damaged" : "",
      number == SIGXCPU   ? fmt::format("takes more than {} s of a processor", kMaxSeconds)
      : number == SIGABRT ? std::string("gave up; it may need more memory than is left")
      : number == SIGKILL ? std::string("was ended by the system, which may lack memory")
      : number != 0       ? fmt::format("failed with signal {}", number)
                          : fmt::format("ended early with status {}", WEXITSTATUS(status))));
}

std::vector<unsigned char> ArrayFile::Read(const StoredArray& array) {
  const std::uint64_t index = static_cast<std::uint64_t>(&array - content_.arrays.data());
  double bytes = static_cast<double>(BytesOf(array.number));
  for (const std::uint64_t count : array.size) bytes *= static_cast<double>(count);
  // Both processes hold the numbers.
  const std::optional<double> left_mib = MemoryLeftMib();
  const double needed_mib = 2 * bytes / (1 << 20);
  if (!(bytes < 1e15) || (left_mib && needed_mib > *left_mib)) {
    throw Error(fmt::format("{}: {} needs at least {:.0f} MiB of memory{}", path_,
                            PrintableUtf8(array.name), needed_mib,
                            left_mib ? fmt::format(", {:.0f} MiB are left", *left_mib) : ""));
  }
  if (send(process_.socket, &index, sizeof index, MSG_NOSIGNAL) != sizeof index) ThrowEnded();
  Received(0);
  std::vector<unsigned char> numbers(static_cast<std::size_t>(bytes));
  Receive(numbers.data(), numbers.size());
  return numbers;
}

}  // namespace thicklens::io
