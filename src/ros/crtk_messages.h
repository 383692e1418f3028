// The two messages of crtk_msgs that CRTK's clients speak, under their own names and sums, so that the node understands
// them without that package, which Debian does not have.
#pragma once

#include <cstdint>
#include <string>

#include <ros/message_traits.h>
#include <ros/serialization.h>
#include <std_msgs/Header.h>

namespace meshless {

/// crtk_msgs/operating_state
struct CrtkOperatingState {
  std_msgs::Header header;
  std::string state;  // DISABLED, ENABLED, PAUSED, FAULT
  std::uint8_t is_homed = 1;
  std::uint8_t is_busy = 0;
};

/// crtk_msgs/StringStamped
struct CrtkString {
  std_msgs::Header header;
  std::string string;
};

}  // namespace meshless

namespace ros {
namespace message_traits {

template <>
struct IsMessage<meshless::CrtkOperatingState> : TrueType {};
template <>
struct IsMessage<meshless::CrtkString> : TrueType {};
template <>
struct HasHeader<meshless::CrtkOperatingState> : TrueType {};
template <>
struct HasHeader<meshless::CrtkString> : TrueType {};

template <>
struct DataType<meshless::CrtkOperatingState> {
  static const char* value() { return "crtk_msgs/operating_state"; }
  static const char* value(const meshless::CrtkOperatingState&) { return value(); }
};
template <>
struct MD5Sum<meshless::CrtkOperatingState> {
  static const char* value() { return "b1bd4021639d9d9c5fbfff78d6ff3158"; }
  static const char* value(const meshless::CrtkOperatingState&) { return value(); }
};
template <>
struct Definition<meshless::CrtkOperatingState> {
  static const char* value() {
    return "std_msgs/Header header\nstring state\nbool is_homed\nbool is_busy\n"
           "================================================================================\n"
           "MSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n";
  }
  static const char* value(const meshless::CrtkOperatingState&) { return value(); }
};

template <>
struct DataType<meshless::CrtkString> {
  static const char* value() { return "crtk_msgs/StringStamped"; }
  static const char* value(const meshless::CrtkString&) { return value(); }
};
template <>
struct MD5Sum<meshless::CrtkString> {
  static const char* value() { return "5e3e46086181199270f1ac3a28a5977f"; }
  static const char* value(const meshless::CrtkString&) { return value(); }
};
template <>
struct Definition<meshless::CrtkString> {
  static const char* value() {
    return "std_msgs/Header header\nstring string\n"
           "================================================================================\n"
           "MSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n";
  }
  static const char* value(const meshless::CrtkString&) { return value(); }
};

}  // namespace message_traits

namespace serialization {

template <>
struct Serializer<meshless::CrtkOperatingState> {
  template <typename Stream, typename T>
  inline static void allInOne(Stream& stream, T message) {
    stream.next(message.header);
    stream.next(message.state);
    stream.next(message.is_homed);
    stream.next(message.is_busy);
  }
  ROS_DECLARE_ALLINONE_SERIALIZER
};
template <>
struct Serializer<meshless::CrtkString> {
  template <typename Stream, typename T>
  inline static void allInOne(Stream& stream, T message) {
    stream.next(message.header);
    stream.next(message.string);
  }
  ROS_DECLARE_ALLINONE_SERIALIZER
};

}  // namespace serialization
}  // namespace ros
