#include "thicklens/io/video_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <system_error>
#include <utility>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "tools/io/image_file_kind.h"
#include "tools/io/image_library.h"
#include "tools/io/video/frame_spool.h"
#include "tools/io/video/video_decoder.h"
#include "tools/io/video/video_kind.h"

namespace thicklens::io {
namespace {

constexpr std::size_t kMaxKeptBytes = std::size_t{128} << 20;
constexpr double kNoSpool = std::numeric_limits<double>::infinity();  // no disk has so much left

// The first bytes of a regular file; empty if it cannot be read.
std::string StartOf(const std::string& path) {
  std::error_code failure;
  if (!std::filesystem::is_regular_file(path, failure)) return "";
  std::ifstream file(path, std::ios::binary);
  std::string start(kVideoStart, '\0');
  file.read(start.data(), kVideoStart);
  start.resize(static_cast<std::size_t>(std::max<std::streamsize>(file.gcount(), 0)));
  return start;
}

// The ending without its point.
std::string LowerCaseEnding(const std::string& path) {
  std::string ending = std::filesystem::path(path).extension().string();
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return ending.empty() ? ending : ending.substr(1);
}

// How a kind of video that is not read becomes one that is, without loss; empty: it is no such
// kind.
std::string ConversionOf(const std::string& start, const std::string& path) {
  if (start.rfind("YUV4MPEG2 ", 0) == 0)
    return "it is a YUV4MPEG2 file (y4m); write it as ffmpeg -i FILE -c:v ffv1 NEW.mkv does";
  if (start.rfind("GIF8", 0) == 0) {
    return "it is a GIF file, whose frames have at most 256 colours; use the recording that it was "
           "made from";
  }
  if (LowerCaseEnding(path) == "yuv") {
    return "values alone do not state their size and kind; state them to ffmpeg (-f rawvideo "
           "-pixel_format .. -video_size .. -framerate .. -i FILE -c:v ffv1 NEW.mkv)";
  }
  return "";
}

VideoKind RequireVideoKind(const std::string& path) {
  ReportInput(path);
  RequireRegularFile(path);
  const std::string start = StartOf(path);
  if (start.empty()) throw Error(fmt::format("{}: the video is empty or cannot be read", path));
  if (const auto kind = KindOfVideo(start, path)) return *kind;
  if (const std::string conversion = ConversionOf(start, path); !conversion.empty())
    throw Error(fmt::format("{}: this kind of video is not read: {}", path, conversion));
  const auto image = KindOfImage(start);
  const std::string other = image ? NameOf(*image) : NameOfOtherKind(start);
  throw Error(fmt::format(
      "{}: {}; a video is expected: MP4, MOV, Matroska, WebM, AVI, MPEG-TS, or a stream of Motion "
      "JPEG, H.264 or H.265 with its ending",
      path,
      other.empty() ? "its content is no known kind of video"
                    : "it is a file of the kind " + other));
}

void RequireMemoryOfFrame(double width_px, double height_px, double bytes_per_px,
                          const std::string& name) {
  RequireMemory(width_px, height_px, bytes_per_px, name);
}

}  // namespace

bool IsNameOfVideo(const std::string& path) {
  static const std::set<std::string> kEndings = {
      "mp4",  "m4v",  "mov", "mkv", "webm", "avi",  "ts",  "m2ts", "mts", "mjpeg",
      "mjpg", "h264", "avc", "264", "hevc", "h265", "265", "y4m",  "yuv", "gif"};
  return kEndings.count(LowerCaseEnding(path)) > 0;
}

bool IsVideoFile(const std::string& path) {
  const std::string start = StartOf(path);
  return !start.empty() && KindOfVideo(start, path).has_value();
}

bool IsJpegFile(const std::string& path) {
  const std::string start = StartOf(path);
  return KindOfImage(start) == ImageFileKind::kJpeg && !KindOfVideo(start, path);
}

class VideoFile::Reader {
 public:
  explicit Reader(const std::string& path) : path_(path), kind_(RequireVideoKind(path)) {
    if (!HasImageLibrary()) {
      throw Error(fmt::format(
          "{}: video: this build reads none, because it has no GPL parts (THICKLENS_WITH_GPL=OFF); "
          "extract the frames into PNG files (ffmpeg -i FILE %04d.png)",
          path));
    }
    RequireWholeVideo(path, kind_);
    std::error_code ignored;
    file_bytes_ = std::filesystem::file_size(path, ignored);
    Open();
  }

  VideoSurvey Survey() {
    const std::lock_guard<std::mutex> lock(mutex_);
    Open();
    VideoSurvey survey;
    double bytes = 0;
    while (Step()) {
      ThrowIfCancelled();
      const VideoStamp& stamp = stamps_[static_cast<std::size_t>(next_ - 1)];
      bytes += static_cast<double>(stamp.bytes);
      survey.is_interlaced = survey.is_interlaced || stamp.is_interlaced;
    }
    RequireFrames();
    for (std::size_t i = 0; i < stamps_.size(); ++i) {
      model::VideoFrame frame;
      if (stamps_[i].has_stamp && stamps_[0].has_stamp)
        frame.time_s = stamps_[i].time_s - stamps_[0].time_s;
      frame.repeats_previous = i > 0 && stamps_[i].digest == stamps_[i - 1].digest;
      frame.is_damaged = stamps_[i].is_damaged;
      survey.frames.push_back(frame);
    }
    PlaceLosses(decoder_->Losses(), &survey.frames);
    survey.facts = FactsOf(0);
    const double frames = static_cast<double>(stamps_.size());
    survey.compression.bits_per_pixel = 8 * bytes /
                                        (frames * static_cast<double>(survey.facts.width_px) *
                                         static_cast<double>(survey.facts.height_px));
    const auto& last = survey.frames.back().time_s;
    if (last && *last > 0)  // the last frame lasts as long as the others in the mean
      survey.compression.bits_per_second = 8 * bytes / (*last * frames / (frames - 1));
    return survey;
  }

  void PlaceLosses(const VideoLosses& losses, std::vector<model::VideoFrame>* frames) const {
    for (const std::int64_t lost : losses.stamps) {
      const auto next =
          std::find_if(stamps_.begin(), stamps_.end(),
                       [lost](const VideoStamp& stamp) { return stamp.stamp > lost; });
      if (next == stamps_.end()) {
        ++frames->back().lost_after;
      } else {
        ++(*frames)[static_cast<std::size_t>(next - stamps_.begin())].lost_before;
      }
    }
    // Containers with an index have all packets, also damaged ones. In a stream, damage may hide
    // whole frames.
    const bool is_stream = kind_ == VideoKind::kTransportStream || kind_ == VideoKind::kRawMjpeg ||
                           kind_ == VideoKind::kRawH264 || kind_ == VideoKind::kRawHevc;
    const bool is_damaged_inside =
        !losses.stamps.empty() ||
        std::any_of(stamps_.begin(), stamps_.end() - 1,
                    [](const VideoStamp& stamp) { return stamp.is_damaged; });
    frames->back().is_count_doubtful = losses.without_stamp > 0 || (is_stream && is_damaged_inside);
    frames->back().may_be_cut = MayBeCut(path_, kind_);
  }

  void Expect(const std::vector<int>& frames) {
    const std::lock_guard<std::mutex> lock(mutex_);
    expected_.insert(frames.begin(), frames.end());
  }

  DecodedImage Read(int frame) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (frame < 0) throw Error(fmt::format("{}[{}]: frames are counted from 0", path_, frame));
    DecodedImage image;
    const auto kept = kept_.find(frame);
    // The caller may write into its pixels.
    image.pixels = (kept != kept_.end() ? kept->second : DecodeFrame(frame)).clone();
    image.facts = FactsOf(frame);
    return image;
  }

 private:
  std::string NameOfFrame(int frame) const { return fmt::format("{}[{}]", path_, frame); }

  // Also goes back to the first frame.
  void Open() {
    decoder_.reset();
    next_ = 0;
    has_jumped_ = false;
    std::string why;
    const VideoOpening opening{kind_, RequireMemoryOfFrame};
    if (!LoadedImageLibrary().open_video(path_, opening, &decoder_, &why))
      throw Error(fmt::format("{}: cannot be read as a video: {}", path_, why));
  }

  void RequireFrames() const {
    if (stamps_.empty()) {
      throw Error(fmt::format("{}: the video has no frame that can be decoded ({})", path_,
                              decoder_->facts().file_kind));
    }
  }

  // Decodes frame `next_` and compares it with what is known of it; false at the end.
  bool Step() {
    VideoStamp stamp;
    std::string why;
    const VideoDecoder::Step step = decoder_->Next(&stamp, &why);
    if (step == VideoDecoder::Step::kFailure)
      throw Error(fmt::format("{}: cannot be decoded: {}", NameOfFrame(next_), why));
    if (step == VideoDecoder::Step::kEnd) return false;
    const auto index = static_cast<std::size_t>(next_);
    if (index < stamps_.size()) {
      if (stamps_[index].digest != stamp.digest) {
        if (!has_jumped_) throw Error(path_ + ": the file was changed while it was read");
        // The frames behind this key frame depend on those before it: only counting is right.
        can_jump_ = false;
        Open();
        return Step();
      }
    } else {
      stamps_.push_back(stamp);
    }
    ++next_;
    return true;
  }

  cv::Mat PixelsOfFrame() {
    cv::Mat pixels;
    std::string why;
    if (!decoder_->Pixels(&pixels, &why))
      throw Error(fmt::format("{}: cannot be decoded: {}", NameOfFrame(next_ - 1), why));
    return pixels;
  }

  void Keep(int frame, const cv::Mat& pixels) {
    const std::size_t bytes = pixels.total() * pixels.elemSize();
    if (!kept_.emplace(frame, pixels).second) return;
    order_.push_back(frame);
    kept_bytes_ += bytes;
    while (kept_bytes_ > kMaxKeptBytes && order_.size() > 1) {
      kept_.erase(order_.front());
      order_.pop_front();
      kept_bytes_ -= bytes;  // all frames have one size
    }
  }

  cv::Mat DecodeFrame(int frame) {
    if (spool_ && spool_->Has(frame)) {
      const cv::Mat pixels = spool_->Read(frame);
      if (!pixels.empty()) return pixels;
    }
    const bool must_move = frame < next_ || (!IsSpooling() && IsBehindAKey(frame));
    if (must_move && !Jump(frame)) Open();
    if (const auto kept = kept_.find(frame); kept != kept_.end()) return kept->second;
    for (;;) {
      ThrowIfCancelled();
      if (!Step()) {
        RequireFrames();
        throw Error(fmt::format("{}: frame {} is not there: it has {} frames, counted from 0",
                                path_, frame, next_));
      }
      if (!spool_) StartSpool();
      const int decoded = next_ - 1;
      const bool is_wanted = decoded == frame;
      const bool is_spooled = IsSpooling() && expected_.count(decoded) > 0;
      const bool is_kept =
          !IsSpooling() && expected_.count(decoded) > 0 && IsWorthKeeping(decoded, frame);
      if (!is_wanted && !is_kept && (!is_spooled || spool_->Has(decoded))) continue;
      const cv::Mat pixels = PixelsOfFrame();
      if (is_spooled) {
        spool_->Write(decoded, pixels);
      } else {
        // A caller that reads backwards finds the frames before this one.
        Keep(decoded, pixels);
      }
      if (is_wanted) return pixels;
    }
  }

  bool IsSpooling() const { return spool_ && spool_->IsUsable(); }

  // Once the size of frames is known. Frames that fit into the memory that is kept need no file.
  void StartSpool() {
    const double bytes = BytesOfFrame() * static_cast<double>(expected_.size());
    spool_ =
        std::make_unique<FrameSpool>(bytes > static_cast<double>(kMaxKeptBytes) ? bytes : kNoSpool);
  }
  double BytesOfFrame() const {
    const ImageFacts& facts = decoder_->facts();
    return static_cast<double>(facts.width_px) * facts.height_px *
           static_cast<double>(facts.channels.size()) * (facts.container_bits > 8 ? 2 : 1);
  }

  // Whether the frame will still be kept when decoding has arrived at `target`. The conversion of
  // its colours takes longer than its decoding.
  bool IsWorthKeeping(int frame, int target) const {
    return (target - frame) * BytesOfFrame() < static_cast<double>(kMaxKeptBytes) &&
           kept_.count(frame) == 0;
  }

  // The last key frame at or before the frame, as far as it has been counted.
  int KeyOf(int frame) const {
    int key = std::min(frame, static_cast<int>(stamps_.size()) - 1);
    while (key > 0 && !stamps_[static_cast<std::size_t>(key)].is_key) --key;
    return key;
  }
  // Whether decoding from a key frame behind the present place is shorter.
  bool IsBehindAKey(int frame) const {
    constexpr int kFewFrames = 8;  // a jump empties the decoder
    return can_jump_ && KeyOf(frame) > next_ + kFewFrames;
  }

  // Goes to the key frame before `frame`, and keeps it if it is that frame. Returns false if the
  // container does not lead there: decoding then begins at the first frame.
  bool Jump(int frame) {
    const int key = KeyOf(frame);
    if (!can_jump_ || key <= 0) return false;
    const VideoStamp& wanted = stamps_[static_cast<std::size_t>(key)];
    can_jump_ = false;
    std::string why;
    if (!wanted.has_stamp || !decoder_->Seek(wanted.stamp, &why)) return false;
    constexpr int kMaxBefore = 64;  // frames that are shown before the key frame
    for (int i = 0; i < kMaxBefore; ++i) {
      ThrowIfCancelled();
      VideoStamp stamp;
      if (decoder_->Next(&stamp, &why) != VideoDecoder::Step::kFrame) return false;
      if (!stamp.has_stamp || stamp.stamp > wanted.stamp) return false;
      if (stamp.stamp < wanted.stamp) continue;
      if (stamp.digest != wanted.digest) return false;
      can_jump_ = true;
      has_jumped_ = true;
      next_ = key + 1;
      if (key == frame || expected_.count(key) > 0) Keep(key, PixelsOfFrame());
      return true;
    }
    return false;
  }

  // The facts of the file, completed for one frame. Some are known only after decoding.
  ImageFacts FactsOf(int frame) const {
    ImageFacts facts = decoder_->facts();
    facts.page = frame;
    facts.file_bytes = file_bytes_;
    return facts;
  }

  const std::string path_;
  const VideoKind kind_;
  std::uint64_t file_bytes_ = 0;
  std::mutex mutex_;
  std::unique_ptr<VideoDecoder> decoder_;
  int next_ = 0;                    // the number of the frame that is decoded next
  std::vector<VideoStamp> stamps_;  // of the frames that have been counted
  bool can_jump_ = true;            // as far as is known
  bool has_jumped_ = false;         // since the file was opened
  std::set<int> expected_;
  std::unique_ptr<FrameSpool> spool_;  // null: no frame has been decoded yet
  std::map<int, cv::Mat> kept_;
  std::deque<int> order_;
  std::size_t kept_bytes_ = 0;
};

VideoFile::VideoFile(const std::string& path) : reader_(std::make_unique<Reader>(path)) {}
VideoFile::~VideoFile() = default;
VideoFile::VideoFile(VideoFile&&) noexcept = default;
VideoFile& VideoFile::operator=(VideoFile&&) noexcept = default;

VideoSurvey VideoFile::Survey() { return reader_->Survey(); }
void VideoFile::Expect(const std::vector<int>& frames) { reader_->Expect(frames); }
DecodedImage VideoFile::Read(int frame) { return reader_->Read(frame); }

}  // namespace thicklens::io
