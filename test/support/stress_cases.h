// Tables of the stress suite: every case for every kind of body.
#pragma once

#include <tuple>

#include "support/stress.h"

namespace meshless::stress {

/// The part of kinds times cases that share() asks for, one at the least; kinds run fastest.
template <class T>
std::vector<std::tuple<Kind, T>> crossed(const std::vector<Kind>& kinds, const std::vector<T>& cases) {
  std::vector<std::tuple<Kind, T>> all;
  for (const T& one : cases)
    for (const Kind& kind : kinds) all.emplace_back(kind, one);
  const std::vector<std::tuple<Kind, T>> some = thinned(all);
  return some.empty() ? std::vector<std::tuple<Kind, T>>{all.front()} : some;
}

/// For INSTANTIATE_TEST_SUITE_P: the case's name, then the kind's.
template <class T>
std::string crossedName(const testing::TestParamInfo<std::tuple<Kind, T>>& info) {
  return testName(std::get<1>(info.param).name + " " + std::get<0>(info.param).name);
}

inline std::vector<Kind> kindsAlone() {
  std::vector<Kind> kinds;
  for (const Kind& kind : allKinds())
    if (kind.bodies == 1) kinds.push_back(kind);
  return kinds;
}

}  // namespace meshless::stress
