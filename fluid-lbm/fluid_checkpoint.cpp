// The participant's state in a file.
#include <algorithm>
#include <optional>

#include "checkpoint.hpp"
#include "fluid.hpp"

namespace estuary::fluid {
namespace {

// A checkpoint as all ranks read it: the first one has the file, the others hear what is in it, or what is
// wrong with it.
class SharedCheckpoint {
public:
  SharedCheckpoint(const std::filesystem::path& file, Ranks* ranks) : ranks_(ranks) {
    on_first_rank([&] { reader_.emplace(file); });
  }
  void read(const std::string& name, std::span<double> values) const {
    on_first_rank([&] { reader_->read(name, values); });
    if (ranks_ != nullptr && !values.empty()) ranks_->broadcast(0, std::as_writable_bytes(values));
  }
  [[nodiscard]] std::uint64_t read_count(const std::string& name) const {
    std::uint64_t count = 0;
    on_first_rank([&] { count = reader_->read_count(name); });
    return as_first_rank(ranks_, count);
  }
  [[nodiscard]] std::vector<double> read_all(const std::string& name) const {
    std::vector<double> values;
    on_first_rank([&] { values = reader_->read_all(name); });
    broadcast_values(ranks_, values);
    return values;
  }
  [[nodiscard]] double read_number(const std::string& name) const {
    double value = 0;
    read(name, {&value, 1});
    return value;
  }
  // Only there, because it is large: the others get nothing.
  void read_on_first_rank(const std::string& name, std::vector<double>& values, std::size_t count) const {
    on_first_rank([&] {
      values.assign(count, 0.0);
      reader_->read(name, values);
    });
  }

private:
  template <class Read>
  void on_first_rank(const Read& read) const {
    if (ranks_ == nullptr) {
      read();
      return;
    }
    std::string error;
    if (ranks_->rank() == 0) {
      try {
        read();
      } catch (const std::exception& failure) {
        error = *failure.what() != 0 ? failure.what() : "the checkpoint cannot be read";
      }
    }
    error.resize(as_first_rank(ranks_, error.size()));
    if (error.empty()) return;
    ranks_->broadcast(0, std::as_writable_bytes(std::span(error)));
    throw std::runtime_error(error);
  }

  Ranks* ranks_;
  std::optional<CheckpointReader> reader_;
};

}  // namespace

void Fluid::save(const std::filesystem::path& file) {
  Flow::State state;
  flow_->gather(state);
  if (!first_rank()) return;
  CheckpointWriter writer(file);
  writer.add("populations", state.populations);
  if (!state.body_memory.empty()) writer.add("memory of bodies' walls", state.body_memory);
  if (!state.outline_memory.empty()) writer.add("memory of outlines' walls", state.outline_memory);
  if (!state.grain_loads.empty()) writer.add("loads of grains", state.grain_loads);
  writer.add("parity", std::uint64_t{state.parity == Parity::odd});
  writer.add("rules applied", std::uint64_t{state.rules_applied});
  writer.add("steps", steps_);
  writer.add("updates", std::vector<double>{updates_});
  grains_.save(writer);
  writer.add("time", std::vector<double>{time_});
  if (flow_->wet_surface()) {
    writer.add("displacement", accepted_.displacement);
    writer.add("velocity", accepted_.velocity);
  }
  for (const SideName name : {left, right, bottom, top, back, front}) {
    const Side& side = flow_->sides()[name];
    std::vector<double> values = side.velocity_x;
    values.insert(values.end(), side.velocity_y.begin(), side.velocity_y.end());
    values.insert(values.end(), side.velocity_z.begin(), side.velocity_z.end());
    values.insert(values.end(), side.excess.begin(), side.excess.end());
    if (!values.empty()) writer.add(std::string("side ") + side_names[name], values);
  }
  writer.commit();
}

void Fluid::load(const std::filesystem::path& file) {
  const SharedCheckpoint reader(file, ranks_);
  Flow::State state;
  flow_->copy_to(state);
  reader.read_on_first_rank("populations", state.populations, flow_->values_of_whole_state());
  flow_->scatter(state);
  if (!state.body_memory.empty()) state.body_memory = reader.read_all("memory of bodies' walls");
  if (!state.outline_memory.empty()) state.outline_memory = reader.read_all("memory of outlines' walls");
  if (!state.grain_loads.empty()) state.grain_loads = reader.read_all("loads of grains");
  state.parity = reader.read_count("parity") == 1 ? Parity::odd : Parity::even;
  state.rules_applied = state.sides_complete = reader.read_count("rules applied") == 1;
  steps_ = reader.read_count("steps");
  updates_ = reader.read_number("updates");
  for (const SideName name : {left, right, bottom, top, back, front}) {
    Side& side = flow_->sides()[name];
    std::vector<double> values(side.velocity_x.size() + side.velocity_y.size() + side.velocity_z.size() +
                               side.excess.size());
    if (values.empty()) continue;
    reader.read(std::string("side ") + side_names[name], values);
    auto from = values.begin();
    for (auto* to : {&side.velocity_x, &side.velocity_y, &side.velocity_z, &side.excess}) {
      const auto past = from + static_cast<std::ptrdiff_t>(to->size());
      std::copy(from, past, to->begin());
      from = past;
    }
  }
  if (flow_->wet_surface()) {
    reader.read("displacement", accepted_.displacement);
    reader.read("velocity", accepted_.velocity);
    latest_ = accepted_;
  }
  grains_.load([&](const char* name, std::span<double> values) { reader.read(name, values); });
  time_ = end_time_ = reader.read_number("time");
  place_bodies(time_, 1.0, false);
  restart_body_loads();
  set_time(time_);
  give_back(state);
  fields_current_ = false;
  steps_checked_ = steps_;
  flow_->apply_boundaries();
  restart_exchanged();
  add_exchanged(1.0);
  evaluate_loads();
}

}  // namespace estuary::fluid
