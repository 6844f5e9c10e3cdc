// The board between the computing thread and the one that reports.
#include <gtest/gtest.h>

#include <thread>

#include "participant.hpp"

namespace estuary {
namespace {

TEST(ProgressBoard, ShowsWhatWasLastReported) {
  ProgressBoard board;
  EXPECT_EQ(board.snapshot().phase, "idle");
  EXPECT_EQ(board.snapshot().counter, 0U);
  board.begin_phase("advance");
  board.report(0.25, "step 10");
  EXPECT_EQ(board.snapshot().phase, "advance");
  EXPECT_EQ(board.snapshot().fraction, 0.25);
  EXPECT_EQ(board.snapshot().note, "step 10");
}

TEST(ProgressBoard, CountsEverySignOfLife) {
  ProgressBoard board;
  board.begin_phase("advance");
  const auto before = board.snapshot().counter;
  board.report(0.5);
  board.report(0.5);
  EXPECT_EQ(board.snapshot().counter, before + 2) << "the same fraction again is work too";
}

TEST(ProgressBoard, ForgetsTheLastPhaseWhenANewOneBegins) {
  ProgressBoard board;
  board.begin_phase("advance");
  board.report(0.9, "step 90");
  board.begin_phase("accept");
  EXPECT_EQ(board.snapshot().phase, "accept");
  EXPECT_LT(board.snapshot().fraction, 0.0);
  EXPECT_EQ(board.snapshot().note, "");
}

TEST(ProgressBoard, PassesARequestToStopBetweenThreads) {
  ProgressBoard board;
  std::jthread worker([&board] {
    double fraction = 0;
    while (!board.stop_requested()) board.report(fraction += 1e-9, "working");
  });
  while (board.snapshot().counter < 100) std::this_thread::yield();
  EXPECT_EQ(board.snapshot().note, "working");
  EXPECT_FALSE(board.stop_requested());
  board.request_stop();
  worker.join();
  EXPECT_TRUE(board.stop_requested());
}

}  // namespace
}  // namespace estuary
