// Bytes from the wire: as a Request to a participant, as a Reply to a coupler.
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <stdexcept>

#include <google/protobuf/stubs/logging.h>

#include "conversation.hpp"
#include "estuary/v1/protocol.pb.h"
#include "session.hpp"
#include "wet_surface.hpp"

namespace {

using namespace estuary;

// Looks at everything that it is given and keeps nothing.
class Onlooker final : public Participant {
public:
  Identity identity() const override { return {"onlooker", "1", {"solid"}, {}, {2, 3}}; }
  Plan configure(Scene& scene, const std::string& role) override {
    SceneTable table = scene.root().table(role);
    table.number_or("density", 1.0, Range::positive());
    if (table.has("image")) (void)table.file("image");
    scene.root().refuse_unknown_keys();
    return {};
  }
  v1::Exchange start(const v1::Exchange& initial, const std::filesystem::path& /*folder*/) override {
    look_at(initial);
    return initial;
  }
  AdvanceResult advance(const Window& /*window*/, const v1::Exchange& inputs,
                        ProgressBoard& /*board*/) override {
    look_at(inputs);
    return {};
  }
  void accept() override {}
  void save(const std::filesystem::path& /*file*/) override {}
  void load(const std::filesystem::path& /*file*/) override {}
  std::vector<std::string> frame(std::uint64_t /*number*/, double /*time*/) override { return {}; }

  static void look_at(const v1::Exchange& exchange) {
    try {
      check_wet_surface(exchange.wet_surface());
      (void)node_count(exchange.wet_surface());
      check_displacements(exchange.displacements(), exchange.wet_surface());
    } catch (const std::invalid_argument& error) {
      throw BadInput("wet_surface", error.what());
    }
    try {
      check_pressures(exchange.pressures(), exchange.wet_surface());
      check_forces(exchange.forces(), exchange.wet_surface());
    } catch (const std::invalid_argument& error) {
      throw BadInput("pressures", error.what());
    }
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::filesystem::path folder = [] {
    std::filesystem::path name = "/dev/shm/estuary-fuzz-message";  // no disk is slowed down
    std::filesystem::create_directories(name);
    return name;
  }();
  static const google::protobuf::LogSilencer silence;  // of what is no UTF-8
  v1::Request request;
  if (request.ParseFromArray(data, static_cast<int>(size))) {
    Onlooker onlooker;
    ProgressBoard board;
    Conversation conversation;
    Session session(onlooker, folder, board, true);
    // The life of a run in short, so that what comes meets a participant in each phase.
    for (int phase = 0; phase < 3; ++phase) {
      const auto judgement = conversation.judge(request);
      if (judgement.course == Conversation::Course::refuse)
        (void)refusal(request.header(), judgement.kind, judgement.message);
      else if (judgement.course == Conversation::Course::carry_out)
        conversation.answered(std::make_shared<const v1::Reply>(session.answer(request)));
      v1::Request next;
      *next.mutable_header() = request.header();
      next.mutable_header()->set_sequence(request.header().sequence() + 1);
      if (phase == 0) {
        next.mutable_configure()->set_role("solid");
        next.mutable_configure()->set_scene("[solid]\n");
      } else {
        next.mutable_start();
      }
      (void)session.answer(next);
      request.mutable_header()->set_sequence(request.header().sequence() + 2);
    }
  }
  v1::Reply reply;
  if (reply.ParseFromArray(data, static_cast<int>(size))) {
    try {
      if (reply.has_started()) Onlooker::look_at(reply.started().initial());
      if (reply.has_advanced()) Onlooker::look_at(reply.advanced().outputs());
    } catch (const std::exception&) {
    }
  }
  return 0;
}
