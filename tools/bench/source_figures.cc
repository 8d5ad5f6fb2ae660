#include "tools/bench/source_figures.h"

#include <cstddef>
#include <numeric>

namespace thicklens::tools {
namespace {

// For 3, 5 and 7 views.
using ByViews = std::array<PublishedFigures, 3>;

struct Row {
  int table;
  const char* implementation;
  ByViews large, small;  // K, L
};

// The paper's "biconjugate gradient" of Eigen can only be BiCGSTAB, because Eigen has no other.
constexpr Row kRows[] = {
    {1,
     "opencl",
     {{{183.72, 181.71, 213.5, 184.26},
       {471.76, 473.28, 462.92, 452.14},
       {664.27, 696.37, 661.74, 680.79}}},
     {{{30.14, 34.94, 23.3, 40.98},
       {84.54, 79.45, 70.09, 88.44},
       {169.95, 154.11, 137.41, 166.18}}}},
    {1,
     "cpu",
     {{{27.31, 25.83, 26.64, 26.72},
       {353.2, 350.48, 351.9, 351.15},
       {855.35, 856.86, 856.85, 855.5}}},
     {{{5.6, 5.61, 5.7, 5.7}, {74.1, 74.52, 74.73, 75.0}, {182.25, 181.97, 182.51, 182.17}}}},
    {2,
     "opencl",
     {{{0.08, 0.08, 0.08, 0.08}, {0.18, 0.16, 0.18, 0.18}, {0.32, 0.34, 0.34, 0.33}}},
     {{{0.02, 0.02, 0.02, 0.02}, {0.04, 0.04, 0.04, 0.04}, {0.07, 0.07, 0.08, 0.08}}}},
    {2,
     "cpu",
     {{{5.5, 5.45, 5.63, 5.46}, {13.47, 13.39, 13.34, 13.34}, {27.4, 27.33, 27.45, 27.61}}},
     {{{1.16, 1.14, 1.15, 1.17}, {2.78, 2.77, 2.76, 2.76}, {5.69, 5.6, 5.61, 5.65}}}},
    {3,
     "bicgstab",
     {{{172.2, 190.93, 189.32, 192.21},
       {526.25, 546.8, 534.43, 537.65},
       {1483.76, 1555.1, 1513.35, 1494.62}}},
     {{{31.5, 32.71, 23.65, 35.96},
       {101.31, 99.42, 86.19, 104.93},
       {310.96, 293.98, 286.95, 311.7}}}},
    {3,
     "umfpack",
     {{{183.72, 181.71, 213.5, 184.26},
       {471.76, 473.28, 462.92, 452.14},
       {664.27, 696.37, 661.74, 680.79}}},
     {{{30.14, 34.94, 23.3, 40.98},
       {84.54, 79.44, 70.09, 88.44},
       {169.95, 154.11, 137.41, 166.18}}}},
    {3,
     "viennacl",
     {{{455.83, 1277.23, 1218.64, 1214.7},
       {1514.33, 3681.79, 3967.59, 4096.01},
       {10597.16, 10571.52, 14625.0, 9150.23}}},
     {{{122.77, 98.98, 68.53, 117.43},
       {368.72, 316.61, 317.32, 349.82},
       {1438.3, 1082.43, 1071.3, 1230.38}}}},
};

struct Fidelity {
  const char* lens;
  PublishedFidelity large, small;
};
constexpr Fidelity kFidelities[] = {
    {"thick",
     {{0.99, 0.99, 0.98, 0.96}, {1.54, 2.72, 2.20, 1.97}},
     {{0.99, 0.98, 0.99, 1.0}, {2.26, 2.56, 1.38, 1.09}}},
    {"thin",
     {{0.98, 0.98, 0.98, 0.96}, {1.63, 2.83, 2.22, 1.98}},
     {{0.99, 0.99, 1.0, 1.0}, {2.0, 2.27, 1.12, 1.01}}},
};

}  // namespace

std::optional<PublishedFigures> PublishedSeconds(int table, const std::string& implementation,
                                                 char size, int views) {
  if ((size != 'K' && size != 'L') || (views != 3 && views != 5 && views != 7)) return std::nullopt;
  for (const Row& row : kRows) {
    if (row.table != table || implementation != row.implementation) continue;
    return (size == 'K' ? row.large : row.small)[static_cast<std::size_t>((views - 3) / 2)];
  }
  return std::nullopt;
}

std::optional<PublishedFidelity> PublishedFidelityOf(const std::string& lens, char size) {
  if (size != 'K' && size != 'L') return std::nullopt;
  for (const Fidelity& fidelity : kFidelities) {
    if (lens == fidelity.lens) return size == 'K' ? fidelity.large : fidelity.small;
  }
  return std::nullopt;
}

double MeanOf(const PublishedFigures& figures) {
  return std::accumulate(figures.begin(), figures.end(), 0.0) / static_cast<double>(figures.size());
}

}  // namespace thicklens::tools
