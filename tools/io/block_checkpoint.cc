#include "thicklens/io/block_checkpoint.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/io/data_hash.h"

namespace thicklens::io {
namespace {

using nlohmann::json;

constexpr char kKind[] = "thicklens-blocks/1";

// The head of a block's record; a float for each channel and ray follows. Numbers have the byte
// order of this machine: on a machine with another order the hashes would not match.
struct Head {
  std::int32_t block = 0, x = 0, y = 0, width_px = 0, height_px = 0, unknowns = 0;
  std::int32_t iterations = 0, channels = 0;
  std::int64_t entries = 0, rays = 0;
  double rcond = 0;  // NaN if there is none
  double relative_residual = 0;
};
static_assert(sizeof(Head) == 64 && std::is_trivially_copyable_v<Head>);

std::string RecordOf(int block, const estimator::SolvedBlock& solved) {
  const estimator::BlockReport& report = solved.report;
  Head head;
  head.block = block;
  head.x = report.x;
  head.y = report.y;
  head.width_px = report.width_px;
  head.height_px = report.height_px;
  head.unknowns = report.unknowns;
  head.iterations = report.iterations;
  head.channels = static_cast<std::int32_t>(solved.channels.size());
  head.entries = report.entries;
  head.rays =
      solved.channels.empty() ? 0 : static_cast<std::int64_t>(solved.channels.front().size());
  head.rcond = report.rcond.value_or(std::numeric_limits<double>::quiet_NaN());
  head.relative_residual = report.relative_residual;
  std::string record(reinterpret_cast<const char*>(&head), sizeof head);
  for (const std::vector<double>& channel : solved.channels) {
    const std::vector<float> values(channel.begin(), channel.end());
    record.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float));
  }
  return record;
}

std::optional<Head> HeadOf(const std::string& record) {
  Head head;
  if (record.size() < sizeof head) return std::nullopt;
  std::memcpy(&head, record.data(), sizeof head);
  const std::size_t values = (record.size() - sizeof head) / sizeof(float);
  if (head.block < 0 || head.channels < 1 || head.rays < 1) return std::nullopt;
  const auto channels = static_cast<std::size_t>(head.channels);
  const auto rays = static_cast<std::size_t>(head.rays);
  if ((record.size() - sizeof head) % sizeof(float) != 0 || values % channels != 0 ||
      values / channels != rays) {
    return std::nullopt;
  }
  return head;
}

std::optional<estimator::SolvedBlock> BlockOf(const std::string& record) {
  const std::optional<Head> head = HeadOf(record);
  if (!head) return std::nullopt;
  estimator::SolvedBlock solved;
  solved.report = {head->x,         head->y,          head->width_px,
                   head->height_px, head->unknowns,   head->entries,
                   head->rcond,     head->iterations, head->relative_residual};
  if (std::isnan(head->rcond)) solved.report.rcond.reset();
  const char* from = record.data() + sizeof(Head);
  for (std::int32_t channel = 0; channel < head->channels; ++channel) {
    std::vector<float> values(static_cast<std::size_t>(head->rays));
    std::memcpy(values.data(), from, values.size() * sizeof(float));
    from += values.size() * sizeof(float);
    solved.channels.emplace_back(values.begin(), values.end());
  }
  return solved;
}

void AddInPieces(std::string_view bytes, Sha256* hash) {
  constexpr std::size_t kPiece = std::size_t{1} << 26;
  for (std::size_t at = 0; at < bytes.size(); at += kPiece) {
    ThrowIfCancelled();
    hash->Add(bytes.substr(at, kPiece));
  }
}

// Another build may round differently. The hash is empty if the system does not show the program.
std::string HashOfThisProgram() {
  std::ifstream program("/proc/self/exe", std::ios::binary);
  if (!program) return "";
  Sha256 hash;
  std::vector<char> piece(std::size_t{1} << 20);
  while (program.read(piece.data(), static_cast<std::streamsize>(piece.size())) ||
         program.gcount() > 0) {
    hash.Add({piece.data(), static_cast<std::size_t>(program.gcount())});
  }
  return hash.Hex();
}

// A list of pairs and not a map, so that differences are reported in this order.
json DescriptionOf(const std::string& version, const estimator::BlockRun& run) {
  json description = json::array();
  description.push_back({"version", PrintableUtf8(version)});
  description.push_back({"program", HashOfThisProgram()});
  for (const auto& [name, value] : run.settings)
    description.push_back({name, PrintableUtf8(value)});
  description.push_back({"blocks", fmt::format("{}", run.blocks)});
  for (const estimator::BlockRun::Data& data : run.data) {
    Sha256 hash;
    for (const std::string_view bytes : data.bytes) AddInPieces(bytes, &hash);
    description.push_back({data.name, hash.Hex()});
  }
  return description;
}

// Returns a name and a value, or two empty texts.
std::pair<std::string, std::string> PairOf(const json& entry) {
  if (!entry.is_array() || entry.size() != 2 || !entry[0].is_string() || !entry[1].is_string()) {
    return {};
  }
  return {entry[0].get<std::string>(), entry[1].get<std::string>()};
}

bool IsHash(const std::string& value) {
  return value.size() == 64 && value.find_first_not_of("0123456789abcdef") == std::string::npos;
}

// Describes the first difference; an empty text if there is none.
std::string Difference(const json& there, const json& here) {
  if (!there.is_array()) return "its description of the estimate cannot be read";
  for (std::size_t i = 0; i < here.size(); ++i) {
    const auto [name, value] = PairOf(here[i]);
    const auto [other_name, other_value] = PairOf(i < there.size() ? there[i] : json(nullptr));
    if (name != other_name) return fmt::format("it does not state '{}'", name);
    if (value == other_value) continue;
    if (IsHash(value) || name == "version") return fmt::format("the {} differs", name);
    return fmt::format("{} is {} there and {} here", name, PrintableUtf8(other_value), value);
  }
  return "";
}

}  // namespace

struct BlockCheckpoint::Description {
  json fields;
};

BlockCheckpoint::~BlockCheckpoint() = default;

BlockCheckpoint::BlockCheckpoint(const std::string& path, std::string version,
                                 std::function<void(const std::string&)> warn)
    : journal_(path, kKind, ThrowIfCancelled),
      version_(std::move(version)),
      warn_(std::move(warn)),
      there_(std::make_unique<Description>()) {
  // Without a block the file holds nothing that could be lost.
  if (journal_.size() < 2) {
    journal_.Clear();
    return;
  }
  there_->fields = json::parse(journal_.Read(0), nullptr, false);
  for (std::size_t record = 1; record < journal_.size(); ++record) {
    const std::string head = journal_.Read(record, sizeof(Head));
    std::int32_t block = -1;
    if (head.size() == sizeof(Head)) std::memcpy(&block, head.data(), sizeof block);
    if (block >= 0) record_of_block_[block] = record;
  }
}

std::string BlockCheckpoint::Setting(const std::string& name) const {
  if (!there_->fields.is_array()) return "";
  for (const json& entry : there_->fields) {
    const auto [entry_name, value] = PairOf(entry);
    if (entry_name == name) return value;
  }
  return "";
}

std::optional<int> BlockCheckpoint::block_px() const {
  const std::string value = Setting("block_px");
  int block_px = 0;
  const char* end = value.data() + value.size();
  const auto [read, failure] = std::from_chars(value.data(), end, block_px);
  if (failure == std::errc() && read == end && block_px >= 1) return block_px;
  return std::nullopt;
}

std::optional<std::string> BlockCheckpoint::device() const {
  const std::string value = Setting("device");
  if (value == "cpu") return value;
  // "opencl:0:0", with whatever else is used after a comma.
  if (value.rfind("opencl:", 0) == 0) return value.substr(0, value.find_first_of(", "));
  return std::nullopt;
}

void BlockCheckpoint::CountKept() {
  kept_ = is_begun_ ? static_cast<int>(record_of_block_.size()) : 0;
}

void BlockCheckpoint::Begin(const estimator::BlockRun& run) {
  const json here = DescriptionOf(version_, run);
  const std::lock_guard<std::mutex> lock(mutex_);
  if (journal_.size() == 0) {
    here_ = here.dump();
    is_begun_ = true;
    return;
  }
  const std::string difference = Difference(there_->fields, here);
  if (!difference.empty()) {
    throw Error(
        fmt::format("{}: holds blocks of another estimate: {}; continue with the original "
                    "settings, name another file, or remove this one",
                    path(), difference));
  }
  if (journal_.bytes_left_out() > 0 && warn_) {
    warn_(fmt::format("{}: {} bytes at its end are not complete blocks and are ignored", path(),
                      journal_.bytes_left_out()));
  }
  is_begun_ = true;
  CountKept();
}

std::optional<estimator::SolvedBlock> BlockCheckpoint::Find(int block) {
  std::size_t record = 0;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found = record_of_block_.find(block);
    if (found == record_of_block_.end()) return std::nullopt;
    record = found->second;
  }
  return BlockOf(journal_.Read(record));
}

void BlockCheckpoint::Keep(int block, const estimator::SolvedBlock& solved) {
  const std::string record = RecordOf(block, solved);
  const std::lock_guard<std::mutex> lock(mutex_);
  if (here_.empty()) {
    journal_.Append({record});
  } else {
    journal_.Append({here_, record});
    here_.clear();
  }
  record_of_block_[block] = journal_.size() - 1;
  CountKept();
}

bool BlockCheckpoint::Remove() {
  const std::lock_guard<std::mutex> lock(mutex_);
  is_begun_ = false;
  CountKept();
  return journal_.Remove();
}

}  // namespace thicklens::io
