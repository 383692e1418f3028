// How answers are filled in: success, message, error_code. For services and for the results of actions.
#pragma once

#include <type_traits>

#include <meshless_surgery/Hash.h>
#include <ros/console.h>

#include "border_check.h"
#include "convert.h"
#include "rejections.h"
#include "runner.h"

namespace meshless {

constexpr std::size_t kLongestMessage = 2000;  // characters: names of megabytes are not sent back

template <class Response, class = void>
struct HasErrorCode : std::false_type {};  // std_srvs' answers
template <class Response>
struct HasErrorCode<Response, std::void_t<decltype(Response::error_code)>> : std::true_type {};

template <class Response>
bool fillRefused(Response& response, const Error& error) {
  response.success = false;
  response.message = printable(error.detail, kLongestMessage);
  if constexpr (HasErrorCode<Response>::value) response.error_code = toErrorCode(error.code);
  return true;
}

struct Answers {
  // Always true: the caller is to see the reason, not a broken call.
  template <class Response>
  bool refuse(Response& response, const std::string& caller, const Error& error) const {
    fillRefused(response, error);
    if (error.code != ErrorCode::kMissed) rejections.count("~" + caller, response.message);
    ROS_DEBUG_STREAM("~" << caller << " refused: " << response.message);
    return true;
  }
  template <class Response>
  bool accept(Response& response, const std::string& message) const {
    response.success = true;
    response.message = message;
    if constexpr (HasErrorCode<Response>::value) response.error_code = 0;
    return true;
  }

  /// ~hash of both nodes.
  bool answerHash(WorldRunner& runner, meshless_surgery::Hash::Response& response) const {
    const Status done = runner.look([&](World& world) {
      response.hash = world.stateHash();
      response.step = world.stepCount();
      response.sim_time = world.simTime();
    });
    if (!done.ok()) return refuse(response, "hash", done.error());
    return accept(response, "the state before step " + std::to_string(response.step));
  }

  Rejections& rejections;
};

inline std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

}  // namespace meshless
