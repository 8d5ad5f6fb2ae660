#!/usr/bin/env python3
"""Writes the files of this folder with ffmpeg 5.1 (Debian 12: ffmpeg), see README.md."""
import subprocess

WIDTH, HEIGHT, FRAMES = 48, 32, 12


def rgb(n):
    """The pixels of frame n: four areas of one colour each, rows from the top."""
    colours = [(60 + 8 * n, 120, 180 - 8 * n), (200 - 8 * n,) * 3, (40, 60 + 8 * n, 100),
               (100 + 4 * n,) * 3]
    rows = bytearray()
    for y in range(HEIGHT):
        for x in range(WIDTH):
            rows += bytes(colours[2 * (y >= HEIGHT // 2) + (x >= WIDTH // 2)])
    return bytes(rows)


def grey10(n):
    """Values of 10 bits, little endian: 64 + 8 x + 16 n."""
    row = b"".join((64 + 8 * x + 16 * n).to_bytes(2, "little") for x in range(WIDTH))
    return row * HEIGHT


def write(name, *options, frames=None, pixels="rgb24", rate="10"):
    data = frames if frames is not None else [rgb(n) for n in range(FRAMES)]
    subprocess.run(["ffmpeg", "-v", "error", "-y", "-fflags", "+bitexact", "-f", "rawvideo",
                    "-pix_fmt", pixels, "-s", f"{WIDTH}x{HEIGHT}", "-r", rate, "-i", "-",
                    "-flags:v", "+bitexact", "-fflags", "+bitexact", "-map_metadata", "-1",
                    *options, name], input=b"".join(data), check=True)


def copy(source, name, *options):
    subprocess.run(["ffmpeg", "-v", "error", "-y", "-i", source, "-c", "copy", "-fflags",
                    "+bitexact", *options, name], check=True)


BT709 = ["-vf", "scale=out_color_matrix=bt709:out_range=tv", "-colorspace", "bt709",
         "-color_primaries", "bt709", "-color_trc", "bt709", "-color_range", "tv"]
H264 = ["-c:v", "libx264", "-crf", "4", "-g", "5", "-bf", "2", "-pix_fmt", "yuv420p"]

write("constant.mp4", *BT709, *H264)
write("variable.mkv", "-vf", "setpts='if(lt(N,6),0.1*N,0.6+0.25*(N-6))/TB'", "-vsync", "vfr", *H264)
write("motion_jpeg.avi", "-c:v", "mjpeg", "-q:v", "2", "-pix_fmt", "yuvj420p")
write("ten_bits.webm", "-vf", "scale=out_color_matrix=bt2020:out_range=tv", "-colorspace",
      "bt2020nc", "-color_trc", "bt2020-10", "-color_range", "tv", "-c:v", "libvpx-vp9", "-pix_fmt",
      "yuv420p10le", "-lossless", "1", "-g", "6")
write("full_range.mp4", "-vf", "scale=out_color_matrix=bt601:out_range=pc", "-colorspace",
      "smpte170m", "-color_trc", "iec61966-2-1", "-color_range", "pc", *H264)
write("colours.mkv", "-c:v", "ffv1", "-pix_fmt", "bgr0")
write("grey10.mkv", "-c:v", "ffv1", "-pix_fmt", "gray10le", frames=[grey10(n) for n in range(4)],
      pixels="gray10le")
twice = [rgb(n) for n in (0, 1, 1, 2, 3, 3, 3, 4)]
write("repeated.mkv", "-c:v", "ffv1", "-pix_fmt", "bgr0", frames=twice)
copy("constant.mp4", "turned.mp4", "-metadata:s:v", "rotate=90")
copy("constant.mp4", "stream.ts")
copy("constant.mp4", "raw.h264", "-bsf:v", "h264_mp4toannexb")
copy("motion_jpeg.avi", "raw.mjpeg", "-f", "mjpeg")
subprocess.run(["ffmpeg", "-v", "error", "-y", "-f", "lavfi", "-i", "sine=duration=0.2:r=8000",
                "-c:a", "aac", "-fflags", "+bitexact", "sound.mp4"], check=True)
