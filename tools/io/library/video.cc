// Videos by FFmpeg's libraries.
//
// OpenImageIO 2.4, which contains a reader of videos on top of the same libraries, does not
// suffice: it states no time stamps, it finds a frame by multiplying its number with a constant
// frame rate (of a video with a variable rate it returned an image that no frame has), it converts
// colours by the coefficients of BT.601 whatever the file states, and it opens files by the ending
// of their name. OpenCV's videoio converts each frame to 8 bits of blue, green and red.
extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/display.h>
}

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <exception>
#include <limits>
#include <memory>
#include <mutex>
#include <set>
#include <utility>

#include "tools/io/library/decoders.h"
#include "tools/io/library/video_pixels.h"

namespace thicklens::io {
namespace {

// What FFmpeg last complained about, instead of printing it. Its own threads complain too.
std::mutex complaint_mutex;
std::string complaint;

void KeepComplaint(void* object, int level, const char* format, va_list arguments) {
  if (level > AV_LOG_ERROR) return;
  std::array<char, 512> line{};
  int begins_line = 0;  // its prefix has an address in memory
  av_log_format_line2(object, level, format, arguments, line.data(), line.size(), &begins_line);
  const std::lock_guard<std::mutex> lock(complaint_mutex);
  complaint = line.data();
  while (!complaint.empty() && std::isspace(static_cast<unsigned char>(complaint.back())) != 0)
    complaint.pop_back();
}

void SetUpFfmpeg() {
  static std::once_flag once;
  std::call_once(once, [] { av_log_set_callback(KeepComplaint); });
}

std::string TakeComplaint() {
  const std::lock_guard<std::mutex> lock(complaint_mutex);
  return std::exchange(complaint, "");
}

// The reason of FFmpeg's error code, with its last complaint.
std::string ReasonOf(int code) {
  std::array<char, AV_ERROR_MAX_STRING_SIZE> text{};
  av_strerror(code, text.data(), text.size());
  const std::string more = TakeComplaint();
  return text.data() + (more.empty() ? "" : " (" + more + ")");
}

// Reads the one file that was opened. FFmpeg itself opens nothing: a video may name other files and
// addresses.
class VideoBytes {
 public:
  explicit VideoBytes(const std::string& path) : file_(open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
    struct stat state {};
    if (file_ < 0 || fstat(file_, &state) != 0) {
      const std::string why = std::strerror(errno);
      if (file_ >= 0) close(file_);
      throw Refusal("cannot be opened: " + why);
    }
    size_ = state.st_size;
    constexpr int kBufferBytes = 1 << 16;
    auto* const buffer = static_cast<unsigned char*>(av_malloc(kBufferBytes));
    context_ = buffer == nullptr
                   ? nullptr
                   : avio_alloc_context(buffer, kBufferBytes, 0, this, Read, nullptr, Seek);
    if (context_ == nullptr) {
      av_free(buffer);
      close(file_);
      throw Refusal("no memory to read a video");
    }
  }
  ~VideoBytes() {
    av_freep(&context_->buffer);
    avio_context_free(&context_);
    close(file_);
  }
  VideoBytes(const VideoBytes&) = delete;
  VideoBytes& operator=(const VideoBytes&) = delete;

  AVIOContext* context() { return context_; }
  std::int64_t size() const { return size_; }

 private:
  static int Read(void* self, std::uint8_t* to, int bytes) {
    auto* const file = static_cast<VideoBytes*>(self);
    ssize_t count = 0;
    do {
      count = pread(file->file_, to, static_cast<std::size_t>(bytes), file->at_);
    } while (count < 0 && errno == EINTR);
    if (count < 0) return AVERROR(errno);
    file->at_ += count;
    return count == 0 ? AVERROR_EOF : static_cast<int>(count);
  }
  static std::int64_t Seek(void* self, std::int64_t offset, int whence) {
    auto* const file = static_cast<VideoBytes*>(self);
    const int from = whence & ~AVSEEK_FORCE;
    if (from == AVSEEK_SIZE) return file->size_;
    const std::int64_t base = from == SEEK_CUR ? file->at_ : from == SEEK_END ? file->size_ : 0;
    if (base + offset < 0) return AVERROR(EINVAL);
    file->at_ = base + offset;
    return file->at_;
  }

  int file_;
  std::int64_t size_ = 0, at_ = 0;
  AVIOContext* context_ = nullptr;
};

// While it lives, FFmpeg allocates no larger piece of memory than the tables of a container may
// need: some dozens of bytes for each frame, which has at least one byte in the file. A header that
// lies about its numbers would get gigabytes. The limit is one for the process: it is the largest
// of all videos that are being opened, and leaves room for the frames that other threads decode.
class AllocationLimit {
 public:
  explicit AllocationLimit(std::int64_t file_bytes) {
    constexpr std::int64_t kMinBytes = 256 << 20, kBytesPerByte = 64;
    constexpr std::int64_t kMaxBytes = std::numeric_limits<int>::max();  // FFmpeg's own limit
    const std::int64_t table = std::min(file_bytes, kMaxBytes / kBytesPerByte) * kBytesPerByte;
    const std::lock_guard<std::mutex> lock(mutex_);
    largest_ = std::max(largest_, std::min(kMaxBytes, kMinBytes + table));
    ++count_;
    av_max_alloc(static_cast<std::size_t>(largest_));
  }
  ~AllocationLimit() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (--count_ > 0) return;
    largest_ = 0;
    av_max_alloc(std::numeric_limits<int>::max());
  }
  AllocationLimit(const AllocationLimit&) = delete;
  AllocationLimit& operator=(const AllocationLimit&) = delete;

 private:
  static inline std::mutex mutex_;
  static inline int count_ = 0;  // of the videos that are being opened
  static inline std::int64_t largest_ = 0;
};

struct CloseFormat {
  void operator()(AVFormatContext* format) const { avformat_close_input(&format); }
};
struct FreeCodec {
  void operator()(AVCodecContext* codec) const { avcodec_free_context(&codec); }
};
struct FreePacket {
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
};
struct FreeVideoFrame {
  void operator()(AVFrame* frame) const { av_frame_free(&frame); }
};

const char* NameOfDemuxer(VideoKind kind) {
  switch (kind) {
    case VideoKind::kIsoMedia:
      return "mov";
    case VideoKind::kMatroska:
      return "matroska";
    case VideoKind::kAvi:
      return "avi";
    case VideoKind::kTransportStream:
      return "mpegts";
    case VideoKind::kRawMjpeg:
      return "mjpeg";
    case VideoKind::kRawH264:
      return "h264";
    case VideoKind::kRawHevc:
      break;
  }
  return "hevc";
}

const char* NameOfContainer(VideoKind kind) {
  switch (kind) {
    case VideoKind::kIsoMedia:
      return "MP4 or MOV";
    case VideoKind::kMatroska:
      return "Matroska or WebM";
    case VideoKind::kAvi:
      return "AVI";
    case VideoKind::kTransportStream:
      return "MPEG-TS";
    default:
      break;
  }
  return "raw stream";
}

// FFmpeg invents the time stamps of these: 25 frames per second.
bool HasNoStamps(VideoKind kind) {
  return kind == VideoKind::kRawMjpeg || kind == VideoKind::kRawH264 || kind == VideoKind::kRawHevc;
}

std::string NameOfCodec(AVCodecID codec) {
  switch (codec) {
    case AV_CODEC_ID_H264:
      return "H.264";
    case AV_CODEC_ID_HEVC:
      return "H.265";
    case AV_CODEC_ID_MJPEG:
      return "Motion JPEG";
    case AV_CODEC_ID_RAWVIDEO:
      return "uncompressed";
    default:
      break;
  }
  const AVCodecDescriptor* const known = avcodec_descriptor_get(codec);
  return known == nullptr ? "an unknown codec" : known->name;
}

// The EXIF orientation with the same effect as the matrix, which takes (x, y) of the stored frame
// to (a x + c y, b x + d y) of the shown one; 0: another angle.
int OrientationOf(const std::int32_t* matrix) {
  const auto sign = [](std::int32_t value) { return value == 0 ? 0 : value > 0 ? 1 : -1; };
  const std::array<int, 4> turn = {sign(matrix[0]), sign(matrix[1]), sign(matrix[3]),
                                   sign(matrix[4])};
  const std::array<std::array<int, 4>, 8> known = {{{1, 0, 0, 1},
                                                    {-1, 0, 0, 1},
                                                    {-1, 0, 0, -1},
                                                    {1, 0, 0, -1},
                                                    {0, 1, 1, 0},
                                                    {0, 1, -1, 0},
                                                    {0, -1, -1, 0},
                                                    {0, -1, 1, 0}}};
  const auto found = std::find(known.begin(), known.end(), turn);
  return found == known.end() ? 0 : static_cast<int>(found - known.begin()) + 1;
}

class FfmpegVideo : public VideoDecoder {
 public:
  FfmpegVideo(const std::string& path, const VideoOpening& opening)
      : opening_(opening), bytes_(path) {
    SetUpFfmpeg();
    TakeComplaint();
    OpenContainer();
    FindStream();
    OpenDecoder();
    packet_.reset(av_packet_alloc());
    frame_.reset(av_frame_alloc());
    if (!packet_ || !frame_) throw Refusal("no memory to decode a video");
  }

  const ImageFacts& facts() const override { return facts_; }

  Step Next(VideoStamp* stamp, std::string* why) override {
    try {
      if (!Decode()) return Step::kEnd;
      *stamp = StampOfFrame();
      return Step::kFrame;
    } catch (const std::exception& error) {
      *why = error.what();
    } catch (...) {
      *why = "an exception of the decoder";
    }
    return Step::kFailure;
  }

  bool Pixels(cv::Mat* pixels, std::string* why) override {
    try {
      *pixels = converter_.Convert(*frame_, facts_);
      return true;
    } catch (const std::exception& error) {
      *why = error.what();
    } catch (...) {
      *why = "an exception of the converter of colours";
    }
    return false;
  }

  // Some packets have no image of their own, such as the hidden frames of VP8: without an error
  // none is lost.
  VideoLosses Losses() const override {
    VideoLosses losses;
    if (!is_broken_) return losses;
    losses.stamps.assign(pending_.begin(), pending_.end());
    losses.without_stamp = std::max(pending_without_stamp_, 0);
    return losses;
  }

  bool Seek(std::int64_t stamp, std::string* why) override {
    const int code = av_seek_frame(format_.get(), stream_->index, stamp, AVSEEK_FLAG_BACKWARD);
    if (code < 0) {
      *why = ReasonOf(code);
      return false;
    }
    avcodec_flush_buffers(codec_.get());
    is_draining_ = false;
    lost_packet_ = false;
    pending_.clear();
    pending_without_stamp_ = 0;
    return true;
  }

 private:
  void OpenContainer() {
    AVFormatContext* format = avformat_alloc_context();
    if (format == nullptr) throw Refusal("no memory to open a video");
    format->pb = bytes_.context();
    format->flags |= AVFMT_FLAG_CUSTOM_IO;
    const AVInputFormat* const demuxer = av_find_input_format(NameOfDemuxer(opening_.kind));
    if (demuxer == nullptr) {
      avformat_free_context(format);
      throw Refusal(std::string("this FFmpeg does not read ") + NameOfContainer(opening_.kind));
    }
    const auto open = [&] {
      const AllocationLimit limit(bytes_.size());
      return avformat_open_input(&format, "", demuxer, nullptr);  // frees the context if it fails
    };
    const int code = open();
    if (code < 0) throw Refusal("it cannot be opened: " + ReasonOf(code));
    format_.reset(format);
    // A header that lies would make FFmpeg allocate memory for its size when it looks for more.
    for (unsigned i = 0; i < format->nb_streams; ++i) RequireSize(*format->streams[i]->codecpar);
    const int found = avformat_find_stream_info(format, nullptr);
    if (found < 0) throw Refusal("its streams cannot be read: " + ReasonOf(found));
  }

  void RequireSize(const AVCodecParameters& parameters) const {
    if (parameters.codec_type != AVMEDIA_TYPE_VIDEO || parameters.width <= 0) return;
    constexpr double kBytesPerPixel = 6;  // RGB of 16 bits
    opening_.require_memory(parameters.width, parameters.height, kBytesPerPixel, "its frames");
  }

  void FindStream() {
    std::string others;
    int streams = 0;
    for (unsigned i = 0; i < format_->nb_streams; ++i) {
      AVStream* const stream = format_->streams[i];
      stream->discard = AVDISCARD_ALL;
      const AVCodecParameters& parameters = *stream->codecpar;
      // a cover of a film is one image beside it.
      const bool is_cover = (stream->disposition & AV_DISPOSITION_ATTACHED_PIC) != 0;
      if (parameters.codec_type == AVMEDIA_TYPE_VIDEO && !is_cover) {
        ++streams;
        if (stream_ == nullptr) stream_ = stream;
        continue;
      }
      const char* const type = av_get_media_type_string(parameters.codec_type);
      others += (others.empty() ? "" : ", ") +
                (is_cover ? std::string("a cover image")
                          : NameOfCodec(parameters.codec_id) + " (" + (type ? type : "data") + ")");
    }
    if (stream_ == nullptr) {
      throw Refusal("it has no stream of images" +
                    (others.empty() ? std::string() : "; it has " + others));
    }
    if (streams > 1) {
      throw Refusal("it has " + std::to_string(streams) +
                    " streams of images: extract the one that is meant (ffmpeg -i FILE -map 0:v:0 "
                    "-c copy NEW)");
    }
    stream_->discard = AVDISCARD_DEFAULT;
    RequireSize(*stream_->codecpar);
  }

  void OpenDecoder() {
    const AVCodecParameters& parameters = *stream_->codecpar;
    const AVCodec* const decoder = avcodec_find_decoder(parameters.codec_id);
    if (decoder == nullptr) {
      throw Refusal("its codec, " + NameOfCodec(parameters.codec_id) +
                    ", is not decoded by this FFmpeg");
    }
    codec_.reset(avcodec_alloc_context3(decoder));
    if (!codec_ || avcodec_parameters_to_context(codec_.get(), &parameters) < 0)
      throw Refusal("no memory to decode a video");
    codec_->pkt_timebase = stream_->time_base;
    constexpr std::int64_t kMaxPixels = std::int64_t{1} << 28;
    constexpr int kThreads = 4;
    codec_->max_pixels = kMaxPixels;
    codec_->thread_count = kThreads;
    // Threads for whole frames return other frames of a damaged stream from run to run.
    codec_->thread_type = FF_THREAD_SLICE;
    const int code = avcodec_open2(codec_.get(), decoder, nullptr);
    if (code < 0) throw Refusal("its decoder cannot be opened: " + ReasonOf(code));
    DescribeStream();
  }

  void DescribeStream() {
    const AVCodecParameters& parameters = *stream_->codecpar;
    VideoFacts video;
    video.container = NameOfContainer(opening_.kind);
    video.codec = NameOfCodec(parameters.codec_id);
    const AVCodecDescriptor* const known = avcodec_descriptor_get(parameters.codec_id);
    video.is_lossless = known != nullptr && (known->props & AV_CODEC_PROP_LOSSLESS) != 0 &&
                        (known->props & AV_CODEC_PROP_LOSSY) == 0;
    const AVRational aspect = stream_->sample_aspect_ratio.num != 0
                                  ? stream_->sample_aspect_ratio
                                  : parameters.sample_aspect_ratio;
    if (aspect.num > 0 && aspect.den > 0) video.pixel_aspect = av_q2d(aspect);
    facts_.file_kind = video.codec + " video (" + video.container + ")";
    facts_.video = video;
    std::size_t size = 0;
    const std::uint8_t* const data =
        av_stream_get_side_data(stream_, AV_PKT_DATA_DISPLAYMATRIX, &size);
    if (data == nullptr || size < 9 * sizeof(std::int32_t)) return;
    std::array<std::int32_t, 9> matrix{};
    std::memcpy(matrix.data(), data, sizeof matrix);
    const int orientation = OrientationOf(matrix.data());
    if (orientation > 0) {
      facts_.orientation = orientation;
    } else {
      facts_.notes.emplace_back(
          "It is to be shown turned by an angle that is no multiple of 90 degrees, which is not "
          "applied.");
    }
  }

  // Puts the next frame into `frame_`; false at the end.
  bool Decode() {
    for (;;) {
      const int code = avcodec_receive_frame(codec_.get(), frame_.get());
      if (code == 0) {
        RequireSameFormat();
        return true;
      }
      if (code == AVERROR_EOF) return false;
      if (code == AVERROR(EAGAIN)) {
        Feed();
      } else if (code == AVERROR_INVALIDDATA) {
        lost_packet_ = true;
        is_broken_ = true;
      } else {
        throw Refusal("the decoder fails: " + ReasonOf(code));
      }
    }
  }

  // Gives the decoder the next packet of the stream, or says that there is none.
  void Feed() {
    while (!is_draining_) {
      const int code = av_read_frame(format_.get(), packet_.get());
      if (code < 0) {
        // Nothing behind a place that cannot be read is reached. Containers are checked for
        // their full length beforehand.
        is_draining_ = true;
        avcodec_send_packet(codec_.get(), nullptr);
        if (code != AVERROR_EOF && code != AVERROR_INVALIDDATA)
          throw Refusal("it cannot be read further: " + ReasonOf(code));
        return;
      }
      const bool is_meant = packet_->stream_index == stream_->index;
      const int sent = is_meant ? avcodec_send_packet(codec_.get(), packet_.get()) : 0;
      if (is_meant && (packet_->flags & AV_PKT_FLAG_DISCARD) == 0) Expect(packet_->pts);
      av_packet_unref(packet_.get());
      if (sent == AVERROR(ENOMEM)) throw Refusal("no memory for its frames");
      // A packet that the decoder refuses: its frame is lost, and the next ones may depend on it.
      if (sent < 0) lost_packet_ = is_broken_ = true;
      if (is_meant && sent == 0) return;
    }
    throw Refusal("the decoder asks for data behind the end");
  }

  // A packet was given to the decoder, which returns its frame some packets later.
  void Expect(std::int64_t stamp) {
    if (stamp == AV_NOPTS_VALUE) {
      ++pending_without_stamp_;
    } else {
      pending_.insert(stamp);
    }
  }
  void TakeExpected(std::int64_t stamp) {
    if (stamp == AV_NOPTS_VALUE) {
      --pending_without_stamp_;
    } else if (const auto found = pending_.find(stamp); found != pending_.end()) {
      pending_.erase(found);
    }
  }

  // All frames of a sweep are of one camera in one mode.
  void RequireSameFormat() {
    const auto format = static_cast<AVPixelFormat>(frame_->format);
    if (width_px_ == 0) {
      width_px_ = frame_->width;
      height_px_ = frame_->height;
      format_of_pixels_ = format;
      DescribePixels(*frame_, &facts_);
      opening_.require_memory(width_px_, height_px_, facts_.container_bits == 8 ? 3 : 6,
                              "its frames");
      return;
    }
    if (frame_->width == width_px_ && frame_->height == height_px_ && format == format_of_pixels_)
      return;
    throw Refusal("the size or the kind of its pixels changes from " + std::to_string(width_px_) +
                  " x " + std::to_string(height_px_) + " to " + std::to_string(frame_->width) +
                  " x " + std::to_string(frame_->height) + " px: cut it there");
  }

  VideoStamp StampOfFrame() {
    VideoStamp stamp;
    stamp.stamp = frame_->best_effort_timestamp;
    stamp.has_stamp = stamp.stamp != AV_NOPTS_VALUE && !HasNoStamps(opening_.kind);
    if (stamp.has_stamp)
      stamp.time_s = static_cast<double>(stamp.stamp) * av_q2d(stream_->time_base);
    stamp.is_key = frame_->key_frame != 0;
    stamp.is_interlaced = frame_->interlaced_frame != 0;
    stamp.is_damaged = (frame_->flags & AV_FRAME_FLAG_CORRUPT) != 0 ||
                       frame_->decode_error_flags != 0 || (lost_packet_ && !stamp.is_key);
    if (stamp.is_key) lost_packet_ = false;
    is_broken_ = is_broken_ || stamp.is_damaged;
    TakeExpected(frame_->pts);
    stamp.bytes = std::max(frame_->pkt_size, 0);
    stamp.digest = DigestOfPixels(*frame_);
    return stamp;
  }

  const VideoOpening opening_;
  VideoBytes bytes_;
  std::unique_ptr<AVFormatContext, CloseFormat> format_;
  AVStream* stream_ = nullptr;
  std::unique_ptr<AVCodecContext, FreeCodec> codec_;
  std::unique_ptr<AVPacket, FreePacket> packet_;
  std::unique_ptr<AVFrame, FreeVideoFrame> frame_;
  PixelConverter converter_;
  ImageFacts facts_;
  int width_px_ = 0, height_px_ = 0;
  AVPixelFormat format_of_pixels_ = AV_PIX_FMT_NONE;
  bool is_draining_ = false;
  // Since the last key frame a packet was refused.
  bool lost_packet_ = false;
  // The decoder has found an error anywhere.
  bool is_broken_ = false;
  // The stamps of packets whose frames have not come yet, and how many others have none.
  std::multiset<std::int64_t> pending_;
  int pending_without_stamp_ = 0;
};

}  // namespace

std::unique_ptr<VideoDecoder> OpenVideo(const std::string& path, const VideoOpening& opening) {
  return std::make_unique<FfmpegVideo>(path, opening);
}

}  // namespace thicklens::io
