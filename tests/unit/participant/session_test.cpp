#include "session.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <limits>

#include "temporary_folder.hpp"

namespace estuary {
namespace {

// Writes down which phases were called.
class Recorder final : public Participant {
public:
  Identity identity() const override { return {"recorder", "1", {"solid"}, {}, {2}}; }
  Plan configure(Scene& scene, const std::string& role) override {
    SceneTable table = scene.root().table(role);
    table.number("density", Range::positive());
    if (table.has("image")) image = table.file("image");
    table.refuse_unknown_keys();
    Plan plan;
    plan.variant = "one";
    return plan;
  }
  v1::Exchange start(const v1::Exchange& /*initial*/, const std::filesystem::path& /*folder*/) override {
    calls += "s";
    return {};
  }
  AdvanceResult advance(const Window& /*window*/, const v1::Exchange& /*inputs*/,
                        ProgressBoard& /*board*/) override {
    calls += "a";
    if (fail) fail();
    AdvanceResult result;
    result.watches.push_back({"tip", {{"displacement", 0.25}}});
    result.work.steps = 3;
    return result;
  }
  void accept() override { calls += "A"; }
  void save(const std::filesystem::path& file) override {
    saved = file;
    if (can_save) std::ofstream(file) << "state";
  }
  void load(const std::filesystem::path& /*file*/) override { calls += "l"; }
  std::vector<std::string> frame(std::uint64_t /*number*/, double /*time*/) override { return {"frame.hdf"}; }

  std::string calls;
  std::string image;
  std::filesystem::path saved;
  bool can_save = true;
  void (*fail)() = nullptr;
};

class SessionTest : public testing::Test {
protected:
  v1::Reply ask(v1::Request request) {
    request.mutable_header()->set_sequence(++sequence_);
    if (request.header().window() == 0) request.mutable_header()->set_window(1);
    if (request.header().iteration() == 0) request.mutable_header()->set_iteration(1);
    return session_.answer(request);
  }
  v1::Reply configure(const std::string& scene) {
    v1::Request request;
    request.mutable_configure()->set_role("solid");
    request.mutable_configure()->set_scene_name("scene.toml");
    request.mutable_configure()->set_scene(scene);
    return ask(request);
  }
  v1::Reply start() {
    v1::Request request;
    request.mutable_start();
    return ask(request);
  }
  v1::Reply advance(bool and_accept = false) {
    v1::Request request;
    request.mutable_advance()->set_duration(0.1);
    request.mutable_advance()->set_accept(and_accept);
    return ask(request);
  }
  v1::Reply accept() {
    v1::Request request;
    request.mutable_accept();
    return ask(request);
  }
  void begin() {
    ASSERT_TRUE(configure("[solid]\ndensity = 1.0\n").configured().problems().empty());
    ASSERT_TRUE(start().has_started());
  }
  Recorder recorder_;
  ProgressBoard board_;
  TemporaryFolder temporary_;
  Session session_{recorder_, temporary_.path(), board_};
  std::uint64_t sequence_ = 0;
};

TEST_F(SessionTest, LivesItsLifeInOrder) {
  begin();
  const v1::Reply reply = advance();
  ASSERT_TRUE(reply.has_advanced());
  EXPECT_EQ(reply.header().sequence(), 3U);
  EXPECT_EQ(reply.advanced().watches(0).name(), "tip");
  EXPECT_EQ(reply.advanced().work().steps(), 3U);
  EXPECT_GT(reply.advanced().work().peak_rss_bytes(), 0U);
  EXPECT_TRUE(accept().has_done());
  v1::Request stop;
  stop.mutable_stop();
  EXPECT_TRUE(ask(stop).has_done());
  EXPECT_TRUE(session_.stopped());
  EXPECT_EQ(recorder_.calls, "saA");
}

TEST_F(SessionTest, GivesAllProblemsOfAScene) {
  const auto configured = configure("[solid]\ndensity = -1.0\ncolour = 3\n").configured();
  ASSERT_EQ(configured.problems_size(), 2);
  EXPECT_EQ(configured.problems(0).line(), 2U);
  EXPECT_EQ(configured.problems(1).line(), 3U);
  EXPECT_EQ(start().error().kind(), v1::Error::OUT_OF_ORDER);
}

// A scene that came over the network names files of the working folder, and no others.
TEST_F(SessionTest, ConfinesFilesOfAScene) {
  const auto folder = temporary_.path() / "run";
  std::filesystem::create_directories(folder / "below");
  for (const auto& file : {folder / "own.png", folder / "below" / "own.png", temporary_.path() / "other.png"})
    std::ofstream(file) << "x";
  std::filesystem::create_symlink(temporary_.path() / "other.png", folder / "link.png");
  std::filesystem::create_directory_symlink(temporary_.path(), folder / "out");
  std::filesystem::create_symlink("own.png", folder / "inner.png");
  const auto named = [&](const std::string& file, bool confined) {
    Session session(recorder_, folder, board_, confined);
    v1::Request request;
    request.mutable_configure()->set_role("solid");
    request.mutable_configure()->set_scene("[solid]\ndensity = 1.0\nimage = \"" + file + "\"\n");
    const auto problems = session.answer(request).configured().problems();
    for (const auto& problem : problems) EXPECT_EQ(problem.line(), 3U) << problem.message();
    return problems.empty();
  };
  const std::string own = (folder / "own.png").string(), other = (temporary_.path() / "other.png").string();
  for (const std::string& file :
       {std::string("own.png"), std::string("./below/../own.png"), own, std::string("inner.png")}) {
    EXPECT_TRUE(named(file, true)) << file;
    EXPECT_EQ(recorder_.image, std::filesystem::canonical(own)) << file;
  }
  EXPECT_TRUE(named("below/own.png", true));
  EXPECT_TRUE(named("not-there.png", true));  // whoever opens it says so
  for (const std::string& file :
       {other, std::string("../other.png"), std::string("below/../../other.png"), std::string("link.png"),
        std::string("out/other.png"), std::string("/etc/passwd"), std::string("."), std::string("..")}) {
    EXPECT_FALSE(named(file, true)) << file;
    EXPECT_EQ(recorder_.image, "") << file;
  }
  EXPECT_TRUE(named(other, false));
  EXPECT_EQ(recorder_.image, other);
}

TEST_F(SessionTest, SavesThroughNoLink) {
  begin();
  const auto elsewhere = temporary_.path() / "elsewhere";
  std::ofstream(elsewhere) << "kept";
  std::filesystem::create_symlink(elsewhere, temporary_.path() / "state.h5");
  v1::Request save;
  save.mutable_save()->set_file("state.h5");
  EXPECT_EQ(ask(save).error().kind(), v1::Error::BAD_MESSAGE);
  v1::Request load;
  load.mutable_load()->set_file("state.h5");
  EXPECT_EQ(ask(load).error().kind(), v1::Error::BAD_MESSAGE);
  EXPECT_TRUE(std::filesystem::exists(elsewhere));
}

TEST_F(SessionTest, RefusesPhasesOutOfOrder) {
  EXPECT_EQ(advance().error().kind(), v1::Error::OUT_OF_ORDER);
  EXPECT_EQ(accept().error().kind(), v1::Error::OUT_OF_ORDER);
  begin();
  EXPECT_EQ(accept().error().kind(), v1::Error::OUT_OF_ORDER);
  EXPECT_EQ(start().error().kind(), v1::Error::OUT_OF_ORDER);
  EXPECT_EQ(ask({}).error().kind(), v1::Error::BAD_MESSAGE);
  EXPECT_TRUE(advance().has_advanced());  // still up
}

TEST_F(SessionTest, AnAdvanceCarriesItsAccept) {
  begin();
  EXPECT_TRUE(advance(true).has_advanced());
  EXPECT_EQ(recorder_.calls, "saA");
  EXPECT_EQ(accept().error().kind(), v1::Error::OUT_OF_ORDER);
  recorder_.fail = [] { throw Diverged("velocity", "not finite", ""); };
  EXPECT_EQ(advance(true).error().kind(), v1::Error::DIVERGED);
  EXPECT_EQ(recorder_.calls, "saAa");  // what failed is not accepted
}

TEST_F(SessionTest, RefusesWindowsThatAreNoTime) {
  begin();
  for (const double bad :
       {-1.0, std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()}) {
    v1::Request request;
    request.mutable_advance()->set_duration(bad);
    EXPECT_EQ(ask(request).error().kind(), v1::Error::BAD_MESSAGE);
  }
}

TEST_F(SessionTest, TurnsExceptionsIntoErrorsAndStaysUp) {
  begin();
  const auto kind_of = [&](void (*fail)()) {
    recorder_.fail = fail;
    return advance().error();
  };
  const auto diverged = kind_of([] { throw Diverged("velocity", "too fast", "a smaller step"); });
  EXPECT_EQ(diverged.kind(), v1::Error::DIVERGED);
  EXPECT_EQ(diverged.field(), "velocity");
  EXPECT_EQ(diverged.advice(), "a smaller step");
  EXPECT_EQ(kind_of([] { throw NotConverged("no equilibrium", "more steps"); }).kind(),
            v1::Error::NOT_CONVERGED);
  EXPECT_EQ(kind_of([] { throw BadInput("inputs.forces", "too short"); }).kind(), v1::Error::BAD_MESSAGE);
  EXPECT_EQ(kind_of([] { throw std::invalid_argument("too short"); }).kind(), v1::Error::BAD_MESSAGE);
  EXPECT_EQ(kind_of([] { throw std::runtime_error("disk full"); }).kind(), v1::Error::FAILED);
  EXPECT_EQ(kind_of([] { throw std::bad_alloc(); }).kind(), v1::Error::FAILED);
  EXPECT_EQ(accept().error().kind(), v1::Error::OUT_OF_ORDER);  // a failed advance cannot be accepted
  recorder_.fail = nullptr;
  EXPECT_TRUE(advance().has_advanced());
}

TEST_F(SessionTest, WritesCheckpointsInsideItsFolderOnly) {
  begin();
  for (const std::string bad : {"../x", "/etc/x", "a/b", "", "..", "."}) {
    v1::Request request;
    request.mutable_save()->set_file(bad);
    EXPECT_EQ(ask(request).error().kind(), v1::Error::BAD_MESSAGE) << bad;
  }
  v1::Request request;
  request.mutable_save()->set_file("window-3.h5");
  const v1::Reply saved = ask(request);
  EXPECT_TRUE(saved.has_done());
  EXPECT_EQ(recorder_.saved, temporary_.path() / "window-3.h5");
  EXPECT_EQ(saved.done().digest().bytes(), 5U);  // "state"
  recorder_.can_save = false;
  EXPECT_EQ(ask(request).error().kind(), v1::Error::FAILED);  // and what was there is not taken for it
}

TEST_F(SessionTest, LoadsOnlyWhatWasSaved) {
  begin();
  v1::Request save;
  save.mutable_save()->set_file("window-3.h5");
  v1::Request load;
  load.mutable_load()->set_file("window-3.h5");
  *load.mutable_load()->mutable_digest() = ask(save).done().digest();
  EXPECT_TRUE(ask(load).has_done());
  EXPECT_EQ(recorder_.calls.back(), 'l');
  recorder_.calls = "-";
  std::ofstream(temporary_.path() / "window-3.h5") << "statf";
  EXPECT_NE(ask(load).error().message().find("is damaged"), std::string::npos);
  std::ofstream(temporary_.path() / "window-3.h5") << "stat";
  EXPECT_NE(ask(load).error().message().find("is damaged"), std::string::npos);
  EXPECT_EQ(recorder_.calls, "-");  // it was not even read
}

}  // namespace
}  // namespace estuary
