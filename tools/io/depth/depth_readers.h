#ifndef THICKLENS_TOOLS_IO_DEPTH_DEPTH_READERS_H_
#define THICKLENS_TOOLS_IO_DEPTH_DEPTH_READERS_H_

#include <opencv2/core/mat.hpp>
#include <string>

#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_file.h"

// One reader per kind of file; depth_file.cc selects it by the first bytes. Each throws Error that
// begins with `name`.
namespace thicklens::io {

// A PFM file of one channel ("Pf").
DepthFile DecodePfmDepth(const std::string& bytes, const std::string& name, PfmScale scale);
// The factor of the values of a PFM file whose header states a scale of this magnitude; `file` gets
// a note if it is not 1.
double PfmFactor(double magnitude, PfmScale scale, DepthFile* file);
// The value of a depth map for a stored one.
float PfmValue(double factor, float stored);

bool IsZip(const std::string& bytes);
// The kind of the archive, and how one array is saved if it is an NPZ file, an archive of NPY
// files.
std::string WordsOnZip(const std::string& bytes, const std::string& name);
bool IsNpy(const std::string& bytes);
DepthFile DecodeNpyDepth(const std::string& bytes, const std::string& name);

// Any kind that DecodeImageFile reads.
DepthFile DecodeImageDepth(const std::string& bytes, const std::string& name,
                           const DepthReading& reading);

// Why an image of three different channels is no depth map: the colour map on which its colours
// lie, with the share that does, or that they lie on none.
std::string WordsOnColours(const cv::Mat& rgb, bool is_lossy);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_DEPTH_DEPTH_READERS_H_
