#include "calib/registration/tile_map.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <random>
#include <vector>

namespace thicklens::calib {
namespace {

constexpr double kTilePx = 90;

double Window(double t) { return std::pow(std::cos(3.14159265358979 * t / kTilePx), 4); }

// The displacement that a tile measures: the weighted mean, summed pixel by pixel.
Eigen::Vector2d Seen(const Eigen::Vector2d& centre_px, const DisplacementField& field) {
  Eigen::Vector2d sum(0, 0);
  double total = 0;
  for (double y = -44.5; y < 45; ++y) {
    for (double x = -44.5; x < 45; ++x) {
      const double weight = Window(x) * Window(y);
      const Eigen::Vector2d p = centre_px + Eigen::Vector2d(x, y);
      sum += weight * (field.shift_px + field.linear * p + field.cubic * p.squaredNorm() * p);
      total += weight;
    }
  }
  return sum / total;
}

double Moment() {
  double sum = 0, total = 0;
  for (double x = -44.5; x < 45; ++x) {
    sum += x * x * Window(x);
    total += Window(x);
  }
  return sum / total;
}

DisplacementField Truth() {
  DisplacementField field;
  field.shift_px << 0.3, -0.2;
  field.linear << 1e-3, 4e-4, -3e-4, 2e-3;
  field.cubic = 3e-7;
  return field;
}

std::vector<TileShift> Tiles(const DisplacementField& field, double sigma_px, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, 1);
  std::vector<TileShift> tiles;
  for (int j = 0; j < 4; ++j) {
    for (int i = 0; i < 4; ++i) {
      TileShift tile;
      tile.centre_px << -80 + 55 * i, -85 + 55 * j;
      tile.shift_px =
          Seen(tile.centre_px, field) + sigma_px * Eigen::Vector2d(noise(random), noise(random));
      tile.information.setIdentity();
      tile.information /= std::pow(std::max(sigma_px, 1e-4), 2);
      tiles.push_back(tile);
    }
  }
  return tiles;
}

TEST(FitDisplacement, IsExactOnWhatTilesSee) {
  const DisplacementField truth = Truth();
  const auto found = FitDisplacement(Tiles(truth, 0, 1), Moment());
  ASSERT_TRUE(found);
  EXPECT_NEAR((found->shift_px - truth.shift_px).norm(), 0, 1e-6);
  EXPECT_NEAR((found->linear - truth.linear).norm(), 0, 1e-8);
  EXPECT_NEAR(found->cubic / truth.cubic, 1, 1e-4);
  EXPECT_EQ(found->tiles, 16);
}

TEST(FitDisplacement, WrongTilesLoseTheirWeight) {
  const DisplacementField truth = Truth();
  auto tiles = Tiles(truth, 0.01, 2);
  tiles[0].shift_px.x() += 3;
  tiles[9].shift_px.y() -= 0.5;
  const auto found = FitDisplacement(tiles, Moment());
  ASSERT_TRUE(found);
  EXPECT_EQ(found->tiles, 14);
  EXPECT_NEAR((found->linear - truth.linear).norm(), 0, 3e-4);
}

// The stated errors allow for tiles that overlap and share them; these tiles do not.
TEST(FitDisplacement, StatedVariancesCoverTheScatter) {
  const DisplacementField truth = Truth();
  const auto exact = Tiles(truth, 0, 1);
  double stretch = 0, cubic = 0, common = 0;
  constexpr int kRuns = 300;
  std::mt19937 random(4);
  std::normal_distribution<double> noise(0, 0.02);
  for (int run = 0; run < kRuns; ++run) {
    auto tiles = exact;
    for (TileShift& tile : tiles) {
      tile.shift_px += Eigen::Vector2d(noise(random), noise(random));
      tile.information = Eigen::Matrix2d::Identity() / (0.02 * 0.02);
    }
    const auto found = FitDisplacement(tiles, Moment());
    ASSERT_TRUE(found);
    const double s = 0.5 * (found->linear - truth.linear).trace();
    const double c = found->cubic - truth.cubic;
    stretch += s * s / found->stretch_variance / kRuns;
    cubic += c * c / found->cubic_variance / kRuns;
    common += s * c / found->stretch_cubic_covariance / kRuns;
  }
  for (const double part : {stretch, cubic, common}) {
    EXPECT_LT(part, 0.8);
    EXPECT_GT(part, 0.35);
  }
}

TEST(FitDisplacement, RefusesWhatDoesNotFixTheMap) {
  const auto tiles = Tiles(Truth(), 0.01, 3);
  EXPECT_FALSE(FitDisplacement({tiles.begin(), tiles.begin() + 5}, Moment()));
  // If all edges are vertical, the shift along them is unknown.
  auto edges = tiles;
  for (TileShift& tile : edges) tile.information(1, 1) = 0;
  EXPECT_FALSE(FitDisplacement(edges, Moment()));
  // All tiles are in one column.
  auto column = tiles;
  for (TileShift& tile : column) tile.centre_px.x() = 20;
  EXPECT_FALSE(FitDisplacement(column, Moment()));
}

// Tiles after a shift and a rotation, by the closed form of a rotation.
std::vector<TileShift> TurnedTiles(const Eigen::Vector2d& shift_px, double turn_rad) {
  auto tiles = Tiles(DisplacementField(), 0, 1);
  for (TileShift& tile : tiles) {
    const Eigen::Vector2d& p = tile.centre_px;
    tile.shift_px =
        shift_px + Eigen::Vector2d(-std::sin(turn_rad) * p.y(), std::sin(turn_rad) * p.x());
  }
  return tiles;
}

TEST(FitRigid, FindsShiftAndTurn) {
  const Eigen::Vector2d shift_px(0.3, -0.2);
  const auto found = FitRigid(TurnedTiles(shift_px, 2e-3));
  ASSERT_TRUE(found);
  EXPECT_NEAR((found->shift_px - shift_px).norm(), 0, 1e-9);
  EXPECT_NEAR(found->turn_rad, 2e-3, 1e-8);
}

// Each tile of a star determines only the shift across its spokes; together the tiles determine
// both components.
TEST(FitRigid, NeedsNoTileThatKnowsBothAxes) {
  const Eigen::Vector2d shift_px(-0.1, 0.4);
  auto tiles = TurnedTiles(shift_px, -1e-3);
  for (TileShift& tile : tiles) {
    const Eigen::Vector2d along = tile.centre_px.normalized();
    const Eigen::Vector2d across(-along.y(), along.x());
    tile.information = across * across.transpose() * 1e4;
    tile.shift_px += 0.7 * along;  // the component that it does not determine
  }
  const auto found = FitRigid(tiles);
  ASSERT_TRUE(found);
  EXPECT_NEAR((found->shift_px - shift_px).norm(), 0, 1e-6);
  EXPECT_NEAR(found->turn_rad, -1e-3, 1e-8);
}

TEST(FitRigid, WrongTilesLoseTheirWeight) {
  auto tiles = TurnedTiles({0.2, 0.1}, 0);
  tiles[3].shift_px.x() += 2;
  tiles[10].shift_px.y() -= 1;
  const auto found = FitRigid(tiles);
  ASSERT_TRUE(found);
  EXPECT_NEAR((found->shift_px - Eigen::Vector2d(0.2, 0.1)).norm(), 0, 1e-3);
}

TEST(FitRigid, StatedErrorsCoverTheScatter) {
  const auto exact = TurnedTiles({0.2, 0.1}, 1e-3);
  constexpr int kRuns = 300;
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, 0.02);
  double square = 0;
  for (int run = 0; run < kRuns; ++run) {
    auto tiles = exact;
    for (TileShift& tile : tiles) {
      tile.shift_px += Eigen::Vector2d(noise(random), noise(random));
      tile.information = Eigen::Matrix2d::Identity() / (0.02 * 0.02);
    }
    const auto found = FitRigid(tiles);
    ASSERT_TRUE(found);
    const Eigen::Vector2d error = found->shift_px - Eigen::Vector2d(0.2, 0.1);
    square += error.dot(found->shift_covariance_px2.inverse() * error) / (2 * kRuns);
  }
  EXPECT_LT(square, 0.8);  // for the same reason as in FitDisplacement
  EXPECT_GT(square, 0.35);
}

TEST(FitRigid, RefusesWhatDoesNotFixTheShift) {
  auto tiles = TurnedTiles({0.2, 0.1}, 0);
  EXPECT_FALSE(FitRigid({tiles.begin(), tiles.begin() + 5}));
  // All edges are vertical and in one row
  for (TileShift& tile : tiles) tile.information(1, 1) = 0;
  for (TileShift& tile : tiles) tile.centre_px.x() = 0;
  EXPECT_FALSE(FitRigid(tiles));
}

}  // namespace
}  // namespace thicklens::calib
