#include "direct_line.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <thread>

#include "channel.hpp"
#include "line_watch.hpp"

namespace estuary {
namespace {

std::string local_path(const char* name) {
  return (std::filesystem::temp_directory_path() /
          (std::string("estuary-line-") + name + "-" + std::to_string(::getpid())))
      .string();
}

void wait_for(int descriptor) {
  pollfd wait{descriptor, POLLIN, 0};
  ASSERT_EQ(::poll(&wait, 1, 5000), 1);
}

v1::Request advance(int nodes) {
  v1::Request request;
  request.mutable_header()->set_sequence(3);
  auto& displacement = *request.mutable_advance()->mutable_inputs()->mutable_displacements();
  for (int i = 0; i < nodes; ++i) displacement.add_displacement(0.1 * i);
  return request;
}

// Of processor time of this thread.
double thread_seconds() {
  timespec time{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// Both ends of a line.
struct Pair {
  std::array<int, 2> descriptor{};
  DirectLine near;
  DirectLine far;
  static std::array<int, 2> sockets() {
    std::array<int, 2> both{};
    EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, both.data()), 0);
    return both;
  }
  Pair() : descriptor(sockets()), near(descriptor[0]), far(descriptor[1]) {}
};

TEST(DirectLine, CarriesAMessageLargerThanTheSocketHolds) {
  Pair line;
  const v1::Request sent = advance(300'000);
  std::thread writer([&] { EXPECT_EQ(line.near.send(sent), sent.ByteSizeLong() + 8); });
  v1::Request received;
  auto state = DirectLine::Received::nothing;
  while (state == DirectLine::Received::nothing) {
    wait_for(line.far.descriptor());
    state = line.far.receive(received);
  }
  writer.join();
  ASSERT_EQ(state, DirectLine::Received::message);
  EXPECT_EQ(received.SerializeAsString(), sent.SerializeAsString());
  EXPECT_EQ(line.far.bytes_received(), sent.ByteSizeLong() + 8);
  EXPECT_EQ(line.far.receive(received), DirectLine::Received::nothing);
}

TEST(DirectLine, TwoMessagesThatArriveTogetherAreTwo) {
  Pair line;
  ASSERT_NE(line.near.send(advance(3)), 0U);
  ASSERT_NE(line.near.send(advance(5)), 0U);
  v1::Request received;
  ASSERT_EQ(line.far.receive(received), DirectLine::Received::message);
  EXPECT_EQ(received.advance().inputs().displacements().displacement_size(), 3);
  ASSERT_EQ(line.far.receive(received), DirectLine::Received::message);
  EXPECT_EQ(received.advance().inputs().displacements().displacement_size(), 5);
}

TEST(DirectLine, NoticesThatTheOtherEndIsGone) {
  Pair line;
  { const DirectLine gone = std::move(line.far); }
  v1::Request received;
  EXPECT_EQ(line.near.receive(received), DirectLine::Received::closed);
  EXPECT_EQ(line.near.send(advance(3)), 0U);
}

TEST(DirectLine, RefusesWhatIsNoMessage) {
  v1::Request received;
  {
    Pair line;
    const std::array<char, 12> garbage{4, 0, 0, 0, 0, 0, 0, 0, '\xff', '\xff', '\xff', '\xff'};
    ASSERT_EQ(::send(line.near.descriptor(), garbage.data(), garbage.size(), 0), 12);
    EXPECT_THROW((void)line.far.receive(received), ChannelError);
  }
  Pair line;
  const std::uint64_t huge = std::uint64_t{1} << 60U;
  ASSERT_EQ(::send(line.near.descriptor(), &huge, sizeof huge, 0), 8);
  EXPECT_THROW((void)line.far.receive(received), ChannelError);
}

TEST(DirectLine, IsEnteredByThisUserOnlyAndOnlyWhereSomebodyListens) {
  const std::string path = local_path("entrance");
  EXPECT_FALSE(DirectLine::connect(path, DirectLine::Bytes::over_socket));
  DirectLineEntrance entrance(path);
  EXPECT_FALSE(entrance.accept());
  struct stat entry {};
  ASSERT_EQ(::stat(path.c_str(), &entry), 0);
  EXPECT_EQ(entry.st_mode & 0777U, 0600U);
  auto near = DirectLine::connect(path, DirectLine::Bytes::over_socket);
  ASSERT_TRUE(near);
  wait_for(entrance.descriptor());
  auto far = entrance.accept();
  ASSERT_TRUE(far);
  ASSERT_NE(near->send(advance(2)), 0U);
  wait_for(far->descriptor());
  v1::Request received;
  EXPECT_EQ(far->receive(received), DirectLine::Received::message);
}

TEST(DirectLine, LiesBesideLocalAddressesOnly) {
  EXPECT_EQ(direct_line_path("ipc:///tmp/run/fluid"), "/tmp/run/fluid.line");
  EXPECT_EQ(direct_line_path("tcp://127.0.0.1:5555"), "");
  EXPECT_EQ(direct_line_path("ipc:///" + std::string(104, 'x')), "");
}

TEST(ClientChannel, SendsWindowsOverTheLineAndTheRestOverTheChannel) {
  const std::string endpoint = "ipc://" + local_path("both");
  ServerChannel server(endpoint, false);
  DirectLineEntrance entrance(direct_line_path(endpoint));
  ClientChannel client(endpoint);
  client.open_direct_line();
  wait_for(entrance.descriptor());
  auto line = entrance.accept();
  ASSERT_TRUE(line);
  client.send(advance(4));
  wait_for(line->descriptor());
  v1::Request received;
  ASSERT_EQ(line->receive(received), DirectLine::Received::message);
  v1::Reply reply;
  reply.mutable_header()->set_sequence(3);
  ASSERT_NE(line->send(reply), 0U);
  std::array<ClientChannel*, 1> waiting{&client};
  ClientChannel::wait_for_any(waiting, std::chrono::milliseconds(5000));
  const auto answer = client.receive(std::chrono::milliseconds(0));
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->header().sequence(), 3U);
  v1::Request stop;
  stop.mutable_stop();
  client.send(stop);
  const auto incoming = server.receive(std::chrono::milliseconds(5000));
  ASSERT_TRUE(incoming && incoming->request);
  EXPECT_TRUE(incoming->request->has_stop());
  // A line that is closed is left: the next Advance takes the channel.
  line.reset();
  EXPECT_FALSE(client.receive(std::chrono::milliseconds(0)));
  client.send(advance(1));
  const auto again = server.receive(std::chrono::milliseconds(5000));
  ASSERT_TRUE(again && again->request);
  EXPECT_TRUE(again->request->has_advance());
}

// Both ends of a line through memory, entered as a coupler enters it.
class MemoryLine : public testing::Test {
protected:
  void SetUp() override {
    wait_for(entrance_.descriptor());
    far_ = entrance_.accept();
    ASSERT_TRUE(near_ && far_);
    // The far end maps the memory with the first bytes that it takes.
    v1::Request nothing;
    ASSERT_EQ(far_->receive(nothing), DirectLine::Received::nothing);
    ASSERT_TRUE(near_->memory() != nullptr && far_->memory() != nullptr);
  }
  std::string path_ = local_path("memory");
  DirectLineEntrance entrance_{path_};
  std::optional<DirectLine> near_ = DirectLine::connect(path_, DirectLine::Bytes::through_memory);
  std::optional<DirectLine> far_;
};

TEST_F(MemoryLine, CarriesMessagesBothWaysRoundAndRound) {
  LineWatch near_watch;
  std::thread far([&] {
    LineWatch watch;
    std::array<pollfd, 1> watched{{{far_->descriptor(), POLLIN, 0}}};
    const std::array<DirectLine*, 1> lines{&*far_};
    v1::Request request;
    for (int k = 0; k < 3000;) {
      (void)watch.wait(watched, lines, std::chrono::milliseconds(5000));
      if (far_->receive(request) != DirectLine::Received::message) continue;
      v1::Reply reply;
      reply.set_compute_s(request.advance().inputs().displacements().displacement_size());
      ASSERT_NE(far_->send(reply), 0U);
      ++k;
    }
  });
  std::array<pollfd, 1> watched{{{near_->descriptor(), POLLIN, 0}}};
  const std::array<DirectLine*, 1> lines{&*near_};
  v1::Reply reply;
  for (int k = 0; k < 3000; ++k) {
    ASSERT_NE(near_->send(advance(k)), 0U);
    // Now and then long enough for the other to fall asleep.
    if (k % 500 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    while (near_->receive(reply) != DirectLine::Received::message)
      ASSERT_TRUE(near_watch.wait(watched, lines, std::chrono::milliseconds(5000)));
    ASSERT_EQ(reply.compute_s(), k);
  }
  far.join();
}

TEST_F(MemoryLine, CarriesAMessageLargerThanTheMemory) {
  const v1::Request sent = advance(300'000);
  ASSERT_GT(sent.ByteSizeLong(), 4 * SharedStream::capacity);
  std::thread writer([&] { EXPECT_EQ(near_->send(sent), sent.ByteSizeLong() + 8); });
  LineWatch watch;
  std::array<pollfd, 1> watched{{{far_->descriptor(), POLLIN, 0}}};
  const std::array<DirectLine*, 1> lines{&*far_};
  v1::Request received;
  while (far_->receive(received) != DirectLine::Received::message)
    ASSERT_TRUE(watch.wait(watched, lines, std::chrono::milliseconds(5000)));
  writer.join();
  EXPECT_EQ(received.SerializeAsString(), sent.SerializeAsString());
}

TEST_F(MemoryLine, GivesWhatWasSaidBeforeTheOtherEndWentAndThenNoticesIt) {
  ASSERT_NE(near_->send(advance(3)), 0U);
  near_.reset();
  LineWatch watch;
  std::array<pollfd, 1> watched{{{far_->descriptor(), POLLIN, 0}}};
  const std::array<DirectLine*, 1> lines{&*far_};
  v1::Request received;
  ASSERT_EQ(far_->receive(received), DirectLine::Received::message);
  auto state = DirectLine::Received::nothing;
  while (state == DirectLine::Received::nothing) {  // it was rung too
    ASSERT_TRUE(watch.wait(watched, lines, std::chrono::milliseconds(5000)));
    state = far_->receive(received);
  }
  EXPECT_EQ(state, DirectLine::Received::closed);
  EXPECT_EQ(far_->send(advance(3)), 0U);
}

TEST_F(MemoryLine, SleepsThroughLongWaitsAndIsWoken) {
  LineWatch watch;
  std::array<pollfd, 1> watched{{{near_->descriptor(), POLLIN, 0}}};
  const std::array<DirectLine*, 1> lines{&*near_};
  const double before = thread_seconds();
  for (int k = 0; k < 5; ++k) EXPECT_FALSE(watch.wait(watched, lines, std::chrono::milliseconds(20)));
  EXPECT_LT(thread_seconds() - before, 0.02);  // of 0.1 s
  std::thread other([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    EXPECT_NE(far_->send(v1::Reply()), 0U);
  });
  EXPECT_TRUE(watch.wait(watched, lines, std::chrono::milliseconds(5000)));
  other.join();
  v1::Reply reply;
  EXPECT_EQ(near_->receive(reply), DirectLine::Received::message);
}

TEST_F(MemoryLine, RefusesWhatIsNoMessageAndSizesThatAreAbsurd) {
  v1::Request received;
  const std::uint64_t huge = std::uint64_t{1} << 60U;
  ASSERT_EQ(near_->memory()->write(reinterpret_cast<const char*>(&huge), sizeof huge), sizeof huge);
  EXPECT_THROW((void)far_->receive(received), ChannelError);
  const std::array<char, 12> garbage{4, 0, 0, 0, 0, 0, 0, 0, '\xff', '\xff', '\xff', '\xff'};
  ASSERT_EQ(far_->memory()->write(garbage.data(), garbage.size()), garbage.size());
  EXPECT_THROW((void)near_->receive(received), ChannelError);
}

// Memory as somebody faulty hands it over, with the eight bytes that announce it.
DirectLine::Received take_memory(int descriptor) {
  const std::array<int, 2> ends = Pair::sockets();
  DirectLine far(ends[1]);
  std::uint64_t said = ~std::uint64_t{0};
  iovec bytes{&said, sizeof said};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> extra{};
  msghdr message{};
  message.msg_iov = &bytes;
  message.msg_iovlen = 1;
  message.msg_control = extra.data();
  message.msg_controllen = extra.size();
  cmsghdr* head = CMSG_FIRSTHDR(&message);
  head->cmsg_level = SOL_SOCKET;
  head->cmsg_type = SCM_RIGHTS;
  head->cmsg_len = CMSG_LEN(sizeof(int));
  std::memcpy(CMSG_DATA(head), &descriptor, sizeof descriptor);
  EXPECT_EQ(::sendmsg(ends[0], &message, 0), 8);
  ::close(descriptor);
  v1::Request received;
  const auto close_near = [&] { ::close(ends[0]); };
  try {
    const auto state = far.receive(received);
    close_near();
    return state;
  } catch (...) {
    close_near();
    throw;
  }
}

TEST(SharedStream, IsNotMappedWhenItCouldShrinkOrHasAnotherSize) {
  struct stat right {};
  {
    const auto stream = SharedStream::create(true);
    ASSERT_TRUE(stream);
    ASSERT_EQ(::fstat(stream->descriptor(), &right), 0);
    EXPECT_NE(::ftruncate(stream->descriptor(), 0), 0);
    EXPECT_EQ(take_memory(::dup(stream->descriptor())), DirectLine::Received::nothing);
  }
  const auto memory = [](off_t size, int seals) {
    const int descriptor = ::memfd_create("test", MFD_CLOEXEC | MFD_ALLOW_SEALING);
    EXPECT_EQ(::ftruncate(descriptor, size), 0);
    EXPECT_EQ(::fcntl(descriptor, F_ADD_SEALS, seals), 0);
    return descriptor;
  };
  EXPECT_THROW((void)take_memory(memory(right.st_size, F_SEAL_GROW)), ChannelError);
  EXPECT_THROW((void)take_memory(memory(4096, F_SEAL_GROW | F_SEAL_SHRINK)), ChannelError);
  EXPECT_THROW((void)take_memory(::open("/dev/null", O_RDWR | O_CLOEXEC)), ChannelError);
}

TEST(SharedStream, DoesNotBelieveACounterThatCannotBe) {
  auto near = SharedStream::create(true);
  ASSERT_TRUE(near);
  const int descriptor = ::dup(near->descriptor());
  auto far = SharedStream::map(descriptor);
  ASSERT_EQ(near->write("12345678", 8), 8U);
  // The writer's counter of the first direction comes first.
  struct stat entry {};
  ASSERT_EQ(::fstat(near->descriptor(), &entry), 0);
  void* place = ::mmap(nullptr, static_cast<std::size_t>(entry.st_size), PROT_READ | PROT_WRITE, MAP_SHARED,
                       near->descriptor(), 0);
  ASSERT_NE(place, MAP_FAILED);
  *static_cast<std::uint64_t*>(place) = SharedStream::capacity + 1;
  std::array<char, 8> bytes{};
  EXPECT_THROW((void)far.read(bytes.data(), bytes.size()), ChannelError);
  EXPECT_EQ(near->write("12345678", 8), 8U);  // it keeps its own count
  EXPECT_EQ(far.read(bytes.data(), bytes.size()), 8U);
  // Then where the ring was last begun anew: at its beginning, and within a ring of what was taken.
  std::uint64_t& written = static_cast<std::uint64_t*>(place)[0];
  std::uint64_t& begun = static_cast<std::uint64_t*>(place)[1];
  written = begun = 16;
  EXPECT_THROW((void)far.read(bytes.data(), bytes.size()), ChannelError);
  written = begun = 2 * SharedStream::capacity;
  EXPECT_THROW((void)far.read(bytes.data(), bytes.size()), ChannelError);
  ::munmap(place, static_cast<std::size_t>(entry.st_size));
}

TEST(SharedStream, BeginsAnEmptyRingAnewAndKeepsWhatIsUnderWay) {
  auto near = SharedStream::create(true);
  ASSERT_TRUE(near);
  auto far = SharedStream::map(::dup(near->descriptor()));
  struct stat entry {};
  ASSERT_EQ(::fstat(near->descriptor(), &entry), 0);
  void* place =
      ::mmap(nullptr, static_cast<std::size_t>(entry.st_size), PROT_READ, MAP_SHARED, near->descriptor(), 0);
  ASSERT_NE(place, MAP_FAILED);
  const std::string_view memory(static_cast<const char*>(place), static_cast<std::size_t>(entry.st_size));
  std::array<char, 8> bytes{};
  ASSERT_EQ(near->write("at first", 8), 8U);
  const std::size_t beginning = memory.find("at first");
  ASSERT_NE(beginning, std::string_view::npos);
  for (int k = 0; k < 3; ++k) {
    ASSERT_EQ(far.read(bytes.data(), 8), 8U);
    ASSERT_EQ(near->write("repeated", 8), 8U);
    EXPECT_EQ(memory.substr(beginning, 8), "repeated");
  }
  // Nobody has read it: what comes next goes behind it, as much as there is room for, and comes out in order.
  ASSERT_EQ(near->write("the next", 8), 8U);
  EXPECT_EQ(memory.substr(beginning, 16), "repeatedthe next");
  const std::string rest(SharedStream::capacity, 'x');
  EXPECT_EQ(near->write(rest.data(), rest.size()), SharedStream::capacity - 16);
  EXPECT_EQ(near->write("no", 2), 0U);
  std::string all(SharedStream::capacity, ' ');
  EXPECT_EQ(far.read(all.data(), all.size()), SharedStream::capacity);
  EXPECT_EQ(all, "repeatedthe next" + rest.substr(16));
  EXPECT_FALSE(far.readable());
  ::munmap(place, static_cast<std::size_t>(entry.st_size));
}

TEST(LineWatch, SeesWhatComesAndKeepsToItsTimeout) {
  Pair line;
  LineWatch watch;
  std::array<pollfd, 1> watched{{{line.far.descriptor(), POLLIN, 0}}};
  const std::array<DirectLine*, 1> lines{&line.far};
  EXPECT_FALSE(watch.wait(watched, lines, std::chrono::milliseconds(20)));
  EXPECT_NE(line.near.send(advance(3)), 0u);
  EXPECT_TRUE(watch.wait(watched, lines, std::nullopt));
  EXPECT_NE(watched[0].revents & POLLIN, 0);
  std::thread writer([&] {
    v1::Request received;
    EXPECT_EQ(line.far.receive(received), DirectLine::Received::message);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    EXPECT_NE(line.near.send(advance(3)), 0u);
  });
  writer.join();
  EXPECT_TRUE(watch.wait(watched, lines, std::nullopt));
}

TEST(LineWatch, SleepsThroughLongWaits) {
  Pair line;
  LineWatch watch;
  std::array<pollfd, 1> watched{{{line.far.descriptor(), POLLIN, 0}}};
  const std::array<DirectLine*, 1> lines{&line.far};
  const double before = thread_seconds();
  for (int k = 0; k < 5; ++k) EXPECT_FALSE(watch.wait(watched, lines, std::chrono::milliseconds(20)));
  EXPECT_LT(thread_seconds() - before, 0.02);  // of 0.1 s
}

}  // namespace
}  // namespace estuary
