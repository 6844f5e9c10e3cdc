#include "conversation.hpp"

#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include <filesystem>
#include <thread>

#include "channel.hpp"
#include "request_queue.hpp"

namespace estuary {
namespace {

using Course = Conversation::Course;

v1::Request request(std::uint64_t sequence, const char* run = "run") {
  v1::Request made;
  made.mutable_header()->set_protocol_version(protocol_version);
  made.mutable_header()->set_run_id(run);
  made.mutable_header()->set_sequence(sequence);
  made.mutable_advance();
  return made;
}

std::shared_ptr<const v1::Reply> reply_to(const v1::Request& asked) {
  auto reply = std::make_shared<v1::Reply>();
  *reply->mutable_header() = asked.header();
  reply->mutable_advanced();
  return reply;
}

TEST(Conversation, CarriesOutEachRequestOnce) {
  Conversation conversation;
  EXPECT_EQ(conversation.judge(request(1)).course, Course::carry_out);
  EXPECT_EQ(conversation.header_under_way().sequence(), 1U);
  EXPECT_EQ(conversation.judge(request(1)).course, Course::ignore);
  conversation.answered(reply_to(request(1)));
  EXPECT_EQ(conversation.header_under_way().sequence(), 0U);
  EXPECT_EQ(conversation.header_under_way().run_id(), "run");
  EXPECT_EQ(conversation.judge(request(1)).course, Course::repeat);
  EXPECT_EQ(conversation.last_reply()->header().sequence(), 1U);
  EXPECT_EQ(conversation.judge(request(2)).course, Course::carry_out);
}

TEST(Conversation, RefusesWhatDoesNotFitNow) {
  Conversation conversation;
  v1::Request other_version = request(1);
  other_version.mutable_header()->set_protocol_version(protocol_version + 1);
  EXPECT_EQ(conversation.judge(other_version).kind, v1::Error::VERSION);
  EXPECT_EQ(conversation.judge(request(1, "")).kind, v1::Error::BAD_MESSAGE);
  EXPECT_EQ(conversation.judge(request(5)).course, Course::carry_out);
  EXPECT_EQ(conversation.judge(request(1, "another")).kind, v1::Error::BUSY);
  EXPECT_EQ(conversation.judge(request(4)).kind, v1::Error::OUT_OF_ORDER);  // older
  EXPECT_EQ(conversation.judge(request(6)).kind, v1::Error::OUT_OF_ORDER);  // while 5 is worked on
}

TEST(Conversation, IsOneParticipantOfARun) {
  Conversation conversation;
  const auto configure = [](const char* role) {
    v1::Request made = request(1);
    made.mutable_configure()->set_role(role);
    return made;
  };
  EXPECT_EQ(conversation.judge(configure("fluid")).course, Course::carry_out);
  EXPECT_EQ(conversation.judge(configure("solid")).kind, v1::Error::BUSY);
  conversation.answered(reply_to(configure("fluid")));
  EXPECT_EQ(conversation.judge(configure("solid")).kind, v1::Error::BUSY);
  EXPECT_EQ(conversation.judge(configure("fluid")).course, Course::repeat);
}

TEST(Conversation, AStopInterruptsAndEnds) {
  Conversation conversation;
  ASSERT_EQ(conversation.judge(request(1)).course, Course::carry_out);
  v1::Request stop = request(2);
  stop.mutable_stop();
  const auto judgement = conversation.judge(stop);
  EXPECT_EQ(judgement.course, Course::carry_out);
  EXPECT_TRUE(judgement.interrupts);
  const auto first = reply_to(request(1));
  conversation.answered(first);
  EXPECT_FALSE(conversation.ends_with(*first));
  const auto last = reply_to(stop);
  conversation.answered(last);
  EXPECT_TRUE(conversation.ends_with(*last));
}

class Queue : public testing::Test {
protected:
  std::string path_ =
      (std::filesystem::temp_directory_path() / ("estuary-queue-" + std::to_string(::getpid()))).string();
  Conversation conversation_;
  RequestQueue queue_{"ipc://" + path_, conversation_};
};

v1::Reply answer_on(DirectLine& line) {
  pollfd wait{line.descriptor(), POLLIN, 0};
  EXPECT_EQ(::poll(&wait, 1, 5000), 1);
  v1::Reply reply;
  EXPECT_EQ(line.receive(reply), DirectLine::Received::message);
  return reply;
}

TEST_F(Queue, AnswersWhereItWasAsked) {
  ASSERT_TRUE(queue_.offers_direct_line());
  auto line = DirectLine::connect(path_ + ".line", DirectLine::Bytes::over_socket);
  ASSERT_TRUE(line);
  ASSERT_NE(line->send(request(1)), 0U);
  const auto first = queue_.next();
  ASSERT_TRUE(first);
  EXPECT_EQ(first->header().sequence(), 1U);
  EXPECT_FALSE(queue_.reply(reply_to(*first)));
  EXPECT_EQ(answer_on(*line).header().sequence(), 1U);
  queue_.put_request(request(2));
  EXPECT_TRUE(queue_.reply(reply_to(*queue_.next())));
  EXPECT_EQ(queue_.take_reply()->header().sequence(), 2U);
  EXPECT_EQ(queue_.take_reply(), nullptr);
}

TEST_F(Queue, RepeatsAndRefusesOnTheLineWithoutComputing) {
  auto line = DirectLine::connect(path_ + ".line", DirectLine::Bytes::over_socket);
  ASSERT_TRUE(line);
  ASSERT_NE(line->send(request(7)), 0U);
  (void)queue_.reply(reply_to(*queue_.next()));
  EXPECT_TRUE(answer_on(*line).has_advanced());
  ASSERT_NE(line->send(request(7)), 0U);  // a retry
  ASSERT_NE(line->send(request(3)), 0U);  // a stale one
  ASSERT_NE(line->send(request(8)), 0U);
  EXPECT_EQ(queue_.next()->header().sequence(), 8U);
  EXPECT_TRUE(answer_on(*line).has_advanced());
  EXPECT_EQ(answer_on(*line).error().kind(), v1::Error::OUT_OF_ORDER);
}

TEST_F(Queue, EndsWhenItIsClosed) {
  std::thread receiving([&] { queue_.close(); });
  EXPECT_FALSE(queue_.next());
  receiving.join();
  EXPECT_FALSE(queue_.next());
}

TEST_F(Queue, OutlivesALineThatSendsGarbage) {
  {
    auto line = DirectLine::connect(path_ + ".line", DirectLine::Bytes::over_socket);
    ASSERT_TRUE(line);
    v1::Header not_a_request;  // its bytes are no Request
    not_a_request.set_run_id(std::string(50, '\xff'));
    not_a_request.set_protocol_version(1);
    (void)line->send(not_a_request);
  }
  queue_.put_request(request(1));
  ASSERT_TRUE(queue_.next());
  (void)queue_.reply(reply_to(request(1)));
  EXPECT_EQ(queue_.take_reply()->header().sequence(), 1U);
  auto line = DirectLine::connect(path_ + ".line", DirectLine::Bytes::over_socket);
  ASSERT_TRUE(line);
  ASSERT_NE(line->send(request(2)), 0U);
  EXPECT_EQ(queue_.next()->header().sequence(), 2U);
}

}  // namespace
}  // namespace estuary
