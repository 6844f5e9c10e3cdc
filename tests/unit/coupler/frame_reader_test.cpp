// Frames written by the participants' kit as a report reads them; streamlines of flows with known ones;
// tables.
#include "frame_reader.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "csv_file.hpp"
#include "sample_run.hpp"
#include "streamlines.hpp"

namespace estuary::coupler {
namespace {

using ::testing::DoubleNear;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::SampleRun;
using ::testing::SizeIs;

template <typename Action>
std::string failure(Action action) {
  try {
    action();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return {};
}

TEST(FrameReader, GivesAnImageBack) {
  const SampleRun run;
  run.write_frames();
  const auto last = last_frame(run.folder() / "fluid", "frame");
  ASSERT_TRUE(last.has_value());
  EXPECT_EQ(last->time, 7.0);
  const auto image = read_image_frame(last->file);
  EXPECT_EQ(image.nx, 40U);
  EXPECT_EQ(image.ny, 20U);
  EXPECT_DOUBLE_EQ(image.x0, 0.025);
  EXPECT_DOUBLE_EQ(image.spacing, 0.05);
  ASSERT_EQ(image.fields.count("velocity"), 1U);
  const auto& velocity = image.fields.at("velocity");
  EXPECT_EQ(velocity.components, 3U);
  ASSERT_THAT(velocity.values, SizeIs(3 * 800));
  EXPECT_DOUBLE_EQ(velocity.values[3 * (10 * 40 + 7)], 4 * 0.525 * 0.475);
  EXPECT_DOUBLE_EQ(image.fields.at("pressure").values[5], 10.0 - 0.25);
}

TEST(FrameReader, GivesPointsAndSegmentsBack) {
  const SampleRun run;
  run.write_frames();
  const auto particles = read_point_frame(last_frame(run.folder() / "solid", "frame")->file);
  EXPECT_THAT(particles.positions, ElementsAre(1.0, 0.05, 1.05, 0.05, 1.0, 0.1, 1.05, 0.1));
  EXPECT_THAT(particles.segments, SizeIs(0));
  const auto surface = read_point_frame(last_frame(run.folder() / "solid", "surface")->file);
  EXPECT_THAT(surface.segments, ElementsAre(0U, 1U, 1U, 2U));
  EXPECT_EQ(surface.fields.at("displacement").values[3], 0.01);
}

TEST(FrameReader, RefusesTheOtherKindAndWhatIsNoFrame) {
  const SampleRun run;
  run.write_frames();
  run.write("text.hdf", "text");
  EXPECT_THAT(failure([&] { read_image_frame(run.folder() / "solid" / "frame-000003.hdf"); }),
              HasSubstr("is of type 'UnstructuredGrid'; expected ImageData"));
  EXPECT_THAT(failure([&] { read_point_frame(run.folder() / "fluid" / "frame-000003.hdf"); }),
              HasSubstr("is of type 'ImageData'"));
  EXPECT_THAT(failure([&] { read_image_frame(run.folder() / "text.hdf"); }), HasSubstr("cannot be opened"));
  EXPECT_THAT(failure([&] { read_image_frame(run.folder() / "none.hdf"); }), HasSubstr("cannot be opened"));
}

TEST(FrameReader, FindsTheLastFrameThatExistsAndStaysInTheFolder) {
  const SampleRun run;
  run.write_frames();
  run.write("outside.hdf", "x");
  run.write("fluid/frame.hdf.series",
            R"({"files": [{"name": "frame-000003.hdf", "time": 7}, {"name": "gone.hdf", "time": 8},
            {"name": "../outside.hdf", "time": 9}, {"name": 3}, 4]})");
  const auto last = last_frame(run.folder() / "fluid", "frame");
  ASSERT_TRUE(last.has_value());
  EXPECT_EQ(last->file.filename(), "frame-000003.hdf");
  EXPECT_FALSE(last_frame(run.folder() / "solid", "nothing").has_value());
  run.write("fluid/frame.hdf.series", "{");
  EXPECT_FALSE(last_frame(run.folder() / "fluid", "frame").has_value());
}

/// An image whose velocity is `flow` of the position.
template <typename Flow>
ImageFrame image_of(std::size_t nx, std::size_t ny, Flow flow) {
  ImageFrame image{
      .nx = nx, .ny = ny, .x0 = -0.5, .y0 = -0.5, .spacing = 1.0 / static_cast<double>(ny - 1), .fields = {}};
  auto& field = image.fields["velocity"];
  field.components = 2;
  for (std::size_t j = 0; j < ny; ++j) {
    for (std::size_t i = 0; i < nx; ++i) {
      const auto [u, v] = flow(image.x0 + static_cast<double>(i) * image.spacing,
                               image.y0 + static_cast<double>(j) * image.spacing);
      field.values.insert(field.values.end(), {u, v});
    }
  }
  return image;
}

TEST(Streamlines, OfAUniformFlowAreStraightAndRunThrough) {
  const auto image = image_of(201, 51, [](double, double) { return std::pair{2.0, 0.0}; });
  const auto lines = streamlines(image, std::vector<bool>(201 * 51, false), 0.1);
  EXPECT_THAT(lines, SizeIs(10)) << "one in each row of the coarse grid";
  for (const auto& line : lines) {
    double first = line.points.front();
    for (std::size_t i = 0; i < line.points.size(); i += 2) {
      EXPECT_DOUBLE_EQ(line.points[i + 1], line.points[1]);
      EXPECT_GE(line.points[i], first) << "points follow the flow";
      first = line.points[i];
    }
    EXPECT_LT(line.points.front(), -0.5 + 0.05);
    EXPECT_GT(first, 3.5 - 0.05);
  }
}

TEST(Streamlines, OfARotationKeepTheirRadius) {
  const auto image = image_of(101, 101, [](double x, double y) { return std::pair{-y, x}; });
  const auto lines = streamlines(image, std::vector<bool>(101 * 101, false), 0.1);
  ASSERT_FALSE(lines.empty());
  for (const auto& line : lines) {
    const double radius = std::hypot(line.points[0], line.points[1]);
    for (std::size_t i = 0; i < line.points.size(); i += 2) {
      EXPECT_THAT(std::hypot(line.points[i], line.points[i + 1]), DoubleNear(radius, 2e-3));
    }
  }
}

TEST(Streamlines, DoNotEnterWhatIsBlocked) {
  const auto image = image_of(101, 51, [](double, double) { return std::pair{1.0, 0.0}; });
  std::vector<bool> blocked(101 * 51, false);
  for (std::size_t j = 0; j < 51; ++j) blocked[j * 101 + 50] = true;
  const auto lines = streamlines(image, blocked, 0.1);
  ASSERT_FALSE(lines.empty());
  for (const auto& line : lines) {
    const bool left = line.points.front() < 0.5;
    for (std::size_t i = 0; i < line.points.size(); i += 2) EXPECT_EQ(line.points[i] < 0.5, left);
  }
}

TEST(Streamlines, OfNoFlowAreNone) {
  const auto still = image_of(21, 21, [](double, double) { return std::pair{0.0, 0.0}; });
  EXPECT_TRUE(streamlines(still, std::vector<bool>(21 * 21, false), 0.1).empty());
  const auto broken = image_of(21, 21, [](double, double) { return std::pair{std::nan(""), 0.0}; });
  EXPECT_TRUE(streamlines(broken, std::vector<bool>(21 * 21, false), 0.1).empty());
}

TEST(CsvFile, GivesColumnsAndLeavesOutAnUnfinishedLine) {
  const SampleRun run;
  run.write("a.csv", "time,value,verdict\n1,2.5,converged\n2,-1e-3,\n3,4");
  const auto table = read_csv(run.folder() / "a.csv");
  ASSERT_TRUE(table.has_value());
  EXPECT_EQ(table->rows(), 2U);
  EXPECT_THAT(*table->column("time"), ElementsAre(1.0, 2.0));
  EXPECT_THAT(*table->column("value"), ElementsAre(2.5, -1e-3));
  EXPECT_THAT(*table->column("verdict"), Each(::testing::IsNan()));
  EXPECT_EQ(table->column("none"), nullptr);
  EXPECT_FALSE(read_csv(run.folder() / "b.csv").has_value());
  run.write("c.csv", "");
  EXPECT_FALSE(read_csv(run.folder() / "c.csv").has_value());
}

}  // namespace
}  // namespace estuary::coupler
