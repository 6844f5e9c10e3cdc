// replay RECORD [--accepted]: a partner that answers as recorded, to be named as a scene's `solver`.
#include <iostream>
#include <string>
#include <vector>

#include "replay.hpp"
#include "serve.hpp"

int main(int argc, char** argv) {
  std::vector<char*> rest;
  std::string record;
  auto beyond = estuary::Beyond::refuse;
  for (int i = 0; i < argc; ++i) {
    const std::string word = argv[i];
    if (i == 1 && !word.starts_with("-")) {
      record = word;
    } else if (word == "--accepted") {
      beyond = estuary::Beyond::accepted;
    } else {
      rest.push_back(argv[i]);
    }
  }
  if (record.empty()) {
    std::cerr
        << "replay RECORD [--accepted] and the options of every solver: answers as the participant did whose "
           "file RUN/record/<participant>.record this is\n";
    return 2;
  }
  try {
    return estuary::serve(static_cast<int>(rest.size()), rest.data(),
                          std::make_unique<estuary::Replay>(record, beyond));
  } catch (const std::exception& error) {
    std::cerr << "replay: " << error.what() << '\n';
    return 2;
  }
}
