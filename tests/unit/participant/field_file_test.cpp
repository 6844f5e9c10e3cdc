// What field files refuse, and the index of their series. What viewers see in them: read_frames_with_vtk.py.
#include "field_file.hpp"

#include <gmock/gmock.h>
#include <sys/resource.h>

#include <cmath>
#include <csignal>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>

#include "temporary_folder.hpp"

namespace estuary {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class FieldFiles : public ::testing::Test {
protected:
  template <typename Action>
  std::string failure(Action action) const {
    try {
      action();
    } catch (const std::exception& error) {
      return error.what();
    }
    return {};
  }

  std::string image_failure(std::array<std::uint32_t, 3> points, double spacing,
                            const std::vector<FieldView>& fields) const {
    return failure([&] { write_image(file_, points, {0.0, 0.0, 0.0}, spacing, fields); });
  }

  std::string points_failure(std::uint32_t dimension, const std::vector<double>& positions,
                             const std::vector<std::uint32_t>& segments,
                             const std::vector<FieldView>& fields) const {
    return failure([&] { write_points(file_, dimension, positions, segments, fields); });
  }

  [[nodiscard]] std::vector<std::string> files() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
      names.push_back(entry.path().filename().string());
    }
    return names;
  }

  estuary::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_.path() / "frame.hdf";
  std::vector<double> six_ = std::vector<double>(6, 1.0);
};

TEST_F(FieldFiles, OfImagesRefuseWhatCannotBeDrawn) {
  EXPECT_THAT(image_failure({1, 3, 1}, 1.0, {}), AllOf(HasSubstr("frame.hdf"), HasSubstr("1 x 3 x 1")));
  EXPECT_THAT(image_failure({3, 1, 1}, 1.0, {}), HasSubstr("3 x 1 x 1"));
  EXPECT_THAT(image_failure({3, 2, 0}, 1.0, {}), HasSubstr("3 x 2 x 0"));
  EXPECT_THAT(image_failure({3, 2, 1}, 0.0, {}), HasSubstr("a spacing of 0"));
  EXPECT_THAT(image_failure({3, 2, 1}, std::numeric_limits<double>::quiet_NaN(), {}),
              HasSubstr("a spacing of nan"));
  EXPECT_THAT(image_failure({3, 2, 1}, 1.0, {{"p", 2, six_}}),
              HasSubstr("field 'p' has 6 values; 6 points with 2 components need 12"));
  EXPECT_THAT(image_failure({3, 2, 1}, 1.0, {{"p", 4, six_}}), HasSubstr("has 4 components"));
  EXPECT_THAT(image_failure({3, 2, 1}, 1.0, {{"p", 1, six_}, {"p", 1, six_}}),
              HasSubstr("two fields are called 'p'"));
  EXPECT_THAT(image_failure({3, 2, 1}, 1.0, {{"a/b", 1, six_}}), HasSubstr("cannot be called 'a/b'"));
  EXPECT_THAT(image_failure({3, 2, 1}, 1.0, {{"", 1, six_}}), HasSubstr("cannot be called ''"));
  EXPECT_THAT(files(), IsEmpty());
}

TEST_F(FieldFiles, OfPointsRefuseWhatDoesNotFitTogether) {
  EXPECT_THAT(points_failure(1, six_, {}, {}), HasSubstr("must be 2 or 3"));
  EXPECT_THAT(points_failure(2, {1.0, 2.0, 3.0}, {}, {}), HasSubstr("3 coordinates"));
  EXPECT_THAT(points_failure(2, six_, {0, 1, 2}, {}), HasSubstr("3 ends"));
  EXPECT_THAT(points_failure(2, six_, {0, 1, 1, 3}, {}),
              HasSubstr("segment 1 ends at point 3; there are 3 points"));
  EXPECT_THAT(points_failure(2, six_, {}, {{"p", 1, six_}}), HasSubstr("field 'p' has 6 values"));
  EXPECT_THAT(files(), IsEmpty());
}

TEST_F(FieldFiles, ThatCannotBeWrittenAreNamed) {
  file_ = folder_.path() / "no-such-folder" / "frame.hdf";
  EXPECT_THAT(image_failure({3, 2, 1}, 1.0, {}),
              AllOf(HasSubstr("no-such-folder/frame.hdf"), HasSubstr("cannot be created")));
}

TEST_F(FieldFiles, ReplaceAnOlderOneAndLeaveNothingElse) {
  EXPECT_EQ(image_failure({3, 2, 1}, 1.0, {{"p", 1, six_}}), "");
  EXPECT_EQ(image_failure({3, 2, 1}, 1.0, {{"p", 1, six_}}), "");
  EXPECT_THAT(files(), ElementsAre("frame.hdf"));
}

/// While it lives, files cannot grow beyond `bytes`, as on a disk that is nearly full.
class LimitedDisk {
public:
  explicit LimitedDisk(rlim_t bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{.rlim_cur = bytes, .rlim_max = before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  LimitedDisk(const LimitedDisk&) = delete;
  LimitedDisk& operator=(const LimitedDisk&) = delete;
  ~LimitedDisk() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }

private:
  void (*handler_)(int);
  rlimit before_{};
};

TEST_F(FieldFiles, OfAFullDiskAreReportedAndTheOlderFileStays) {
  ASSERT_EQ(image_failure({3, 2, 1}, 1.0, {{"p", 1, six_}}), "");
  const auto size = std::filesystem::file_size(file_);
  std::vector<double> values(100 * 100);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = std::sin(static_cast<double>(i));
  {
    const LimitedDisk disk(20'000);
    EXPECT_THAT(image_failure({100, 100, 1}, 1.0, {{"p", 1, values}}), HasSubstr("frame.hdf"));
  }
  EXPECT_EQ(std::filesystem::file_size(file_), size);
  EXPECT_THAT(files(), ElementsAre("frame.hdf"));
  EXPECT_EQ(image_failure({100, 100, 1}, 1.0, {{"p", 1, values}}), "")
      << "and writing goes on when there is room";
}

class Series : public FieldFiles {
protected:
  [[nodiscard]] std::vector<std::pair<std::string, double>> index() const {
    std::ifstream stream(folder_.path() / "frame.hdf.series");
    std::vector<std::pair<std::string, double>> result;
    const auto parsed = nlohmann::json::parse(stream);
    for (const auto& entry : parsed.at("files")) result.emplace_back(entry.at("name"), entry.at("time"));
    return result;
  }
};

TEST_F(Series, NamesFramesSoThatTheySortByNumber) {
  const FieldSeries series(folder_.path(), "frame");
  EXPECT_EQ(series.file_name(0), "frame-000000.hdf");
  EXPECT_EQ(series.file_name(12), "frame-000012.hdf");
  EXPECT_EQ(series.file_name(1'234'567), "frame-1234567.hdf");
}

TEST_F(Series, IsWholeAfterEachFrame) {
  FieldSeries series(folder_.path(), "frame");
  series.add(0, 0.0);
  EXPECT_THAT(index(), ElementsAre(std::pair{"frame-000000.hdf", 0.0}));
  series.add(1, 0.1);
  EXPECT_THAT(index(), ElementsAre(std::pair{"frame-000000.hdf", 0.0}, std::pair{"frame-000001.hdf", 0.1}));
  EXPECT_THAT(files(), ElementsAre("frame.hdf.series"));
}

TEST_F(Series, GoesOnAfterAResumeAndForgetsFramesThatWillBeWrittenAgain) {
  {
    FieldSeries series(folder_.path(), "frame");
    for (const std::uint64_t number : {0U, 1U, 2U, 3U, 1'000'000U})
      series.add(number, static_cast<double>(number));
  }
  FieldSeries resumed(folder_.path(), "frame");
  resumed.add(2, 2.5);
  EXPECT_THAT(index(), ElementsAre(std::pair{"frame-000000.hdf", 0.0}, std::pair{"frame-000001.hdf", 1.0},
                                   std::pair{"frame-000002.hdf", 2.5}));
  FieldSeries anew(folder_.path(), "frame");
  anew.add(0, 0.0);
  EXPECT_THAT(index(), ElementsAre(std::pair{"frame-000000.hdf", 0.0}));
}

TEST_F(Series, BeginsAnewFromAnIndexThatCannotBeRead) {
  for (const std::string text : {"", "{", "[1]", R"({"files": 3})", R"({"files": [{"name": 3}, 4]})"}) {
    std::ofstream(folder_.path() / "frame.hdf.series") << text;
    FieldSeries series(folder_.path(), "frame");
    series.add(5, 0.5);
    EXPECT_THAT(index(), ElementsAre(std::pair{"frame-000005.hdf", 0.5})) << text;
  }
}

TEST_F(Series, RefusesATimeThatIsNotFinite) {
  FieldSeries series(folder_.path(), "frame");
  EXPECT_THAT(failure([&] { series.add(0, std::numeric_limits<double>::infinity()); }),
              HasSubstr("has the time inf"));
}

}  // namespace
}  // namespace estuary
