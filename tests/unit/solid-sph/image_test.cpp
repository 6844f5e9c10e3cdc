// Bodies from pictures: regions, holes, contours between the pixels.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>

#include "image_outline.hpp"
#include "solid.hpp"

namespace estuary::solid {
namespace {

// Grey by the share of each pixel that is inside, or black and white.
template <class Inside>
GreyImage picture(int width, int height, bool grey, Inside inside) {
  GreyImage image{width, height, {}};
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column) {
      int hits = 0;
      for (int a = 0; a < 8; ++a)
        for (int b = 0; b < 8; ++b)
          hits += inside(column + (a + 0.5) / 8, height - row - (b + 0.5) / 8) ? 1 : 0;
      const double share = grey ? hits / 64.0 : hits >= 32 ? 1.0 : 0.0;
      image.values.push_back(static_cast<std::uint8_t>(std::lround(255 * (1 - share))));
    }
  return image;
}

bool in_disc(double x, double y, double cx, double cy, double r) {
  return std::hypot(x - cx, y - cy) < r;
}

TEST(ImageOutline, MeetsGreyEdgesToAFractionOfAPixel) {
  const auto image =
      picture(60, 50, true, [](double x, double y) { return in_disc(x, y, 31.3, 24.6, 18.2); });
  const auto found = outlines_in_image(image, {.corner = {1, 2}, .pixel = 0.1}, 0.25, 0.1);
  ASSERT_EQ(found.size(), 1U);
  ASSERT_EQ(found[0].size(), 1U);
  EXPECT_NEAR(signed_area(found[0][0]), std::numbers::pi * 1.82 * 1.82, 0.01 * 10.4);
  for (const auto& p : found[0][0]) EXPECT_NEAR(std::hypot(p[0] - 4.13, p[1] - 4.46), 1.82, 0.012);
}

TEST(ImageOutline, TakesTheStaircaseOutOfBlackAndWhite) {
  const auto image =
      picture(60, 50, false, [](double x, double y) { return in_disc(x, y, 31.3, 24.6, 18.2); });
  const auto found = outlines_in_image(image, {.pixel = 0.1}, 0.25, 0.1);
  ASSERT_EQ(found.size(), 1U);
  for (const auto& p : found[0][0]) EXPECT_NEAR(std::hypot(p[0] - 3.13, p[1] - 2.46), 1.82, 0.04);
}

TEST(ImageOutline, PartsRegionsAndGivesEachItsHoles) {
  const auto image = picture(100, 60, false, [](double x, double y) {
    const bool ring = in_disc(x, y, 30, 30, 25) && !in_disc(x, y, 30, 30, 15);
    return ring || in_disc(x, y, 30, 30, 8) || in_disc(x, y, 80, 30, 15) || in_disc(x, y, 97, 3, 1.5);
  });
  const auto found = outlines_in_image(image, {.pixel = 0.01}, 0.03, 0.005);
  ASSERT_EQ(found.size(), 3U);  // the speck is left out
  EXPECT_EQ(found[0].size(), 2U);
  EXPECT_EQ(found[1].size(), 1U);
  EXPECT_EQ(found[2].size(), 1U);
  EXPECT_LT(signed_area(found[0][1]), 0);
  const double pi = std::numbers::pi;
  EXPECT_NEAR(area_moments(found[0]).area, pi * (0.25 * 0.25 - 0.15 * 0.15), 0.02 * 0.12);
  EXPECT_NEAR(area_moments(found[1]).centroid[0], 0.8, 0.002);
  EXPECT_NEAR(area_moments(found[2]).area, pi * 0.08 * 0.08, 0.05 * 0.02);
}

TEST(ImageOutline, ClosesRegionsAtTheRimAndFlips) {
  const auto image = picture(40, 40, true, [](double x, double y) { return x < 10 && y < 20; });
  const auto found = outlines_in_image(image, {.pixel = 0.1}, 0.2, 0.1);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(signed_area(found[0][0]), 2, 0.05);
  const auto flipped = outlines_in_image(image, {.pixel = 0.1, .flip_x = true, .flip_y = true}, 0.2, 0.1);
  ASSERT_EQ(flipped.size(), 1U);
  EXPECT_NEAR(area_moments(flipped[0]).centroid[0], 3.5, 0.02);
  EXPECT_NEAR(area_moments(flipped[0]).centroid[1], 3.0, 0.02);
  const auto bright = outlines_in_image(image, {.pixel = 0.1, .dark = false}, 0.2, 0.1);
  ASSERT_EQ(bright.size(), 1U);
  EXPECT_NEAR(signed_area(bright[0][0]), 14, 0.1);
}

// 24 bits per pixel, rows from the bottom.
void write_bmp(const std::filesystem::path& file, const GreyImage& image) {
  std::ofstream out(file, std::ios::binary);
  const auto number = [&](std::uint32_t value, int bytes) {
    for (int k = 0; k < bytes; ++k) out.put(static_cast<char>(value >> (8 * k) & 255U));
  };
  const auto width = static_cast<std::uint32_t>(image.width),
             height = static_cast<std::uint32_t>(image.height);
  out << "BM";
  number(54 + width * height * 3, 4);
  number(0, 4);
  number(54, 4);
  number(40, 4);
  number(width, 4);
  number(height, 4);
  number(1, 2);
  number(24, 2);
  for (int k = 0; k < 6; ++k) number(0, 4);
  for (int row = image.height - 1; row >= 0; --row) {
    for (int column = 0; column < image.width; ++column)
      for (int c = 0; c < 3; ++c)
        out.put(static_cast<char>(image.values[static_cast<std::size_t>(row * image.width + column)]));
    for (std::uint32_t pad = width * 3; pad % 4 != 0; ++pad) out.put(0);
  }
}

TEST(ImageBodies, OfOnePictureFallTogether) {
  const auto folder = std::filesystem::temp_directory_path() / ("image-" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  write_bmp(folder / "two.bmp", picture(64, 32, true, [](double x, double y) {
              return in_disc(x, y, 16, 16, 12) || in_disc(x, y, 48, 16, 10);
            }));
  const std::string text =
      "title = \"t\"\ndimension = 2\n[coupling]\nmode = \"transient\"\nwindow = 0.1\nend_time = 1\n"
      "[solid]\nsolver = \"solid-sph\"\nspacing = 0.03\ndensity = 1000\nyoung_modulus = 1e5\n"
      "poisson_ratio = 0.3\ngravity = [0, -1]\nwet = [\"contour\"]\n"
      "image = { file = \"" +
      (folder / "two.bmp").string() +
      "\", corner = [0, 0], pixel = 0.01 }\n"
      "[[watch]]\nname = \"small\"\nparticipant = \"solid\"\nbody = \"body 2\"\n";
  Solid solid;
  Scene scene = Scene::parse(text, "scene.toml");
  solid.configure(scene, "solid");
  for (const auto& problem : scene.problems()) ADD_FAILURE() << describe("scene.toml", problem);
  const auto brought = solid.start({}, folder);
  EXPECT_TRUE(brought.wet_surface().closed());
  ProgressBoard board;
  const auto result = solid.advance(
      {.number = 1, .iteration = 1, .mode = Mode::transient, .time = 0, .duration = 0.1}, {}, board);
  ASSERT_EQ(result.watches.size(), 1U);
  for (const auto& [name, value] : result.watches[0].quantities) {
    if (name == "velocity_y") {
      EXPECT_NEAR(value, -0.1, 1e-12);
    } else if (name == "momentum_y") {
      EXPECT_NEAR(value, -0.1 * 1000 * std::numbers::pi * 0.01, 0.03 * 3.14);
    }
  }
  Scene missing = Scene::parse(text, "scene.toml", std::vector<std::string>{"solid.image.file=\"none.png\""});
  Solid other;
  other.configure(missing, "solid");
  std::string all;
  for (const auto& problem : missing.problems()) all += problem.message + "\n";
  EXPECT_THAT(all, testing::HasSubstr("none.png"));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace estuary::solid
