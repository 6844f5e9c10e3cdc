// What tests of a solver as a participant share: variations of a scene, values of its watches.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "participant.hpp"

namespace estuary {

/// `text` with the first `what` replaced, which has to be there.
inline std::string replaced(std::string text, const std::string& what, const std::string& with) {
  const auto at = text.find(what);
  if (at == std::string::npos) {
    ADD_FAILURE() << "not in the scene: " << what;
    return text;
  }
  return text.replace(at, what.size(), with);
}

/// A watched quantity, which has to be there.
inline double value_of(const AdvanceResult& result, const std::string& watch, const std::string& quantity) {
  for (const auto& entry : result.watches)
    if (entry.name == watch)
      for (const auto& [name, value] : entry.quantities)
        if (name == quantity) return value;
  ADD_FAILURE() << watch << "." << quantity << " is not there";
  return 0;
}

}  // namespace estuary
