// The report of a run: complete, self-contained, and still a report when pieces are missing.
#include "report.hpp"

#include <gmock/gmock.h>

#include <cstdlib>

#include "gnuplot.hpp"
#include "particle_picture.hpp"
#include "report_page.hpp"
#include "sample_run.hpp"

namespace estuary::coupler {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::SampleRun;

std::size_t occurrences(const std::string& text, const std::string& word) {
  std::size_t count = 0;
  for (auto at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++count;
  return count;
}

/// While it lives, no program is found on PATH.
class NoPrograms {
public:
  NoPrograms() : before_(std::getenv("PATH")) { setenv("PATH", "/nonexistent", 1); }
  NoPrograms(const NoPrograms&) = delete;
  NoPrograms& operator=(const NoPrograms&) = delete;
  ~NoPrograms() { setenv("PATH", before_.c_str(), 1); }

private:
  std::string before_;
};

/// A run with so many particles whose pictures nobody draws: its gnuplot keeps the last script it was given.
std::string script_of_particles(std::size_t count) {
  const TemporaryFolder folder;
  std::vector<double> particles;
  for (std::size_t i = 0; i < count; ++i)
    particles.insert(particles.end(), {0.1 * static_cast<double>(i), 0.0});
  std::filesystem::create_directories(folder.path() / "run" / "solid");
  FieldSeries frames(folder.path() / "run" / "solid", "frame");
  write_points(folder.path() / "run" / "solid" / frames.file_name(1), 2, particles, {}, {});
  frames.add(1, 1.0);
  const auto program = folder.path() / "gnuplot";
  const auto script = folder.path() / "script";
  std::ofstream(program) << "#!/bin/sh\n/bin/cat >'" << script.string() << "'\necho drawn >'"
                         << (folder.path() / "a.png").string() << "'\n";
  std::filesystem::permissions(program, std::filesystem::perms::owner_all);
  const std::string before = std::getenv("PATH");
  setenv("PATH", folder.path().c_str(), 1);
  draw_particles(folder.path() / "run", "solid", folder.path() / "a.png", true, *Gnuplot::find());
  setenv("PATH", before.c_str(), 1);
  std::ifstream file(script);
  return {std::istreambuf_iterator<char>(file), {}};
}

class Report : public ::testing::Test {
protected:
  std::string page() {
    write_report(run_.folder());
    return run_.read("report.html");
  }
  SampleRun run_;
};

TEST_F(Report, ShowsChecksTimesPlanAndWhatWasLeftOut) {
  run_.write_tables();
  const auto html = page();
  EXPECT_THAT(html,
              AllOf(HasSubstr("Status: check failed."), HasSubstr("tip.displacement"), HasSubstr("3.26 %"),
                    HasSubstr("5 %"), HasSubstr("a book"), HasSubstr("at most 10")));
  EXPECT_EQ(occurrences(html, "<span class=\"good\">holds</span>"), 1U);
  EXPECT_EQ(occurrences(html, "<span class=\"bad\">fails</span>"), 2U);
  EXPECT_THAT(html, AllOf(HasSubstr("collide and stream"), HasSubstr("4711"), HasSubstr("D2Q9 TRT"),
                          HasSubstr("relaxation time"), HasSubstr("Mach number 0.2 is high"),
                          HasSubstr("the grains")));
  EXPECT_THAT(html, HasSubstr("width:66.00%")) << "the fluid computed 8.25 s of 12.5 s";
  EXPECT_THAT(html, HasSubstr("12.5"));
}

TEST_F(Report, ShowsTheBalanceOfTheLastWholeRow) {
  run_.write_tables();
  const auto html = page();
  EXPECT_THAT(html, HasSubstr("3 iterations; the last residual is 5e-05."));
  EXPECT_THAT(html, HasSubstr("1.00e-01")) << "the solid received 2.7 of 3";
  EXPECT_THAT(html, HasSubstr("0.00e+00"));
}

TEST_F(Report, IsOnePageThatNeedsNothingElse) {
  run_.write_tables();
  run_.write_frames();
  const auto html = page();
  EXPECT_EQ(occurrences(html, "<img"), occurrences(html, "src=\"data:image/"));
  EXPECT_THAT(html, AllOf(Not(HasSubstr("<script")), Not(HasSubstr("<link")), Not(HasSubstr("http:")),
                          Not(HasSubstr("https:")), Not(HasSubstr("url("))));
}

TEST_F(Report, DrawsFieldsConvergenceAndWatches) {
  ASSERT_TRUE(Gnuplot::find().has_value()) << "packages.txt names gnuplot-nox";
  run_.write_tables();
  run_.write_frames();
  const auto html = page();
  EXPECT_EQ(occurrences(html, "src=\"data:image/png;base64,"), 2U) << "the flow, and the solid's particles";
  EXPECT_EQ(occurrences(html, "src=\"data:image/svg+xml;base64,"), 2U)
      << "convergence and one watch; the other never changes";
  EXPECT_THAT(html, HasSubstr("The same throughout: always = 7."));
  const auto png = run_.read("report/flow.png");
  EXPECT_EQ(png.substr(1, 3), "PNG");
  EXPECT_GT(png.size(), 20'000U);
  EXPECT_THAT(run_.read("report/convergence.svg"), HasSubstr("tolerance"));
  EXPECT_FALSE(std::filesystem::exists(run_.folder() / "report" / "work"));
}

TEST(ParticlePicture, ShowsEveryParticleUpToTwentyThousand) {
  const auto points = [](std::size_t count) {
    const std::string script = script_of_particles(count);
    const auto begin = script.find("$last << END\n") + 13;
    return occurrences(script.substr(begin, script.find("END\n", begin) - begin), "\n");
  };
  EXPECT_EQ(points(4), 4U);
  EXPECT_EQ(points(20000), 20000U);
  EXPECT_EQ(points(20001), 10001U);
}

TEST_F(Report, EscapesWhatAPersonWrote) {
  run_.write_tables();
  const auto html = page();
  EXPECT_THAT(html, HasSubstr("<title>A &lt;fin&gt; &amp; &#39;more&#39;</title>"));
  EXPECT_THAT(html, AllOf(HasSubstr("&lt;b&gt;x&lt;/b&gt;"), Not(HasSubstr("<b>x</b>"))));
}

TEST_F(Report, CanBeMadeAgain) {
  run_.write_tables();
  run_.write_frames();
  page();
  run_.write("report/stale.png", "x");
  page();
  EXPECT_FALSE(std::filesystem::exists(run_.folder() / "report" / "stale.png"));
}

TEST_F(Report, SaysThatThereAreNoFrames) {
  run_.write_tables();
  EXPECT_THAT(page(), HasSubstr("No participant left frames"));
}

TEST_F(Report, SaysThatAFrameIsDamaged) {
  run_.write_tables();
  run_.write_frames();
  std::filesystem::resize_file(run_.folder() / "fluid" / "frame-000003.hdf", 300);
  EXPECT_THAT(page(), HasSubstr("frame-000003.hdf: cannot be opened"));
}

TEST_F(Report, DoesWithoutGnuplot) {
  run_.write_tables();
  run_.write_frames();
  const NoPrograms none;
  const auto html = page();
  EXPECT_THAT(html, AllOf(HasSubstr("gnuplot is not installed"), HasSubstr("tip.displacement"),
                          Not(HasSubstr("<img"))));
}

TEST_F(Report, DoesWithAnEmptySummary) {
  run_.write("summary.json", "{}");
  EXPECT_THAT(page(), AllOf(HasSubstr("Status: -."), HasSubstr("No participant was launched."),
                            HasSubstr("scene.toml is missing.")));
}

TEST_F(Report, DoesWithASummaryOfOtherTypes) {
  run_.write(
      "summary.json",
      R"({"title": 3, "status": [], "wall_s": "x", "iterations": 4, "participants": {"fluid": 5}, "checks": [1, {}],
             "left_out": {"a": 1}, "coupling": null})");
  run_.write("convergence.csv", "window,residual\n1,abc\n");
  run_.write("watch/a.csv", "time,q\n");
  EXPECT_THAT(page(), HasSubstr("a.csv holds no values."));
}

TEST_F(Report, IsRefusedWithoutASummary) {
  EXPECT_THROW(write_report(run_.folder()), std::runtime_error);
  run_.write("summary.json", "{");
  EXPECT_THROW(write_report(run_.folder()), std::runtime_error);
}

TEST(Base64, MatchesTheVectorsOfRfc4648) {
  const std::vector<std::pair<std::string, std::string>> vectors{{"", ""},
                                                                 {"f", "Zg=="},
                                                                 {"fo", "Zm8="},
                                                                 {"foo", "Zm9v"},
                                                                 {"foob", "Zm9vYg=="},
                                                                 {"fooba", "Zm9vYmE="},
                                                                 {"foobar", "Zm9vYmFy"}};
  for (const auto& [bytes, code] : vectors) EXPECT_EQ(base64(bytes), code);
  EXPECT_EQ(base64(std::string("\xff\x00\x80", 3)), "/wCA");
}

TEST(GnuplotText, CannotLeaveItsQuotes) {
  EXPECT_EQ(Gnuplot::quoted("plain"), "'plain'");
  EXPECT_EQ(Gnuplot::quoted("it's"), "'it''s'");
  EXPECT_EQ(Gnuplot::quoted("a\n!rm x\t"), "'a !rm x '");
}

TEST(GnuplotText, ThatIsNoScriptIsReportedInGnuplotsWords) {
  const auto gnuplot = Gnuplot::find();
  ASSERT_TRUE(gnuplot.has_value());
  const SampleRun run;
  try {
    gnuplot->draw(run.folder() / "a.svg", "svg", "plot $nothing_here");
    FAIL() << "a script that cannot work was accepted";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("a.svg"), HasSubstr("nothing_here")));
  }
  EXPECT_FALSE(std::filesystem::exists(run.folder() / "a.svg"));
}

}  // namespace
}  // namespace estuary::coupler
