// An expected failure is a value: a Result holds either what was asked for or an Error that says why not.
#pragma once

#include <cassert>
#include <string>
#include <utility>
#include <variant>

namespace meshless {

enum class ErrorCode {
  kInvalidArgument,  // a number out of range or not finite
  kUnknownName,      // no such body, material, pick
  kDuplicateName,    // a name that lives or was retired in this run
  kUnreadable,       // a file that is missing, truncated or of an unknown kind
  kForbidden,        // a file outside the allowed folders
  kUnsuitableShape,  // a mesh or cloud that cannot become what was asked for
  kMissed,           // nothing was met (a cut beside the tissue, a pick into the air)
  kUnsupported,      // known, and not possible in this version
  kFailed            // anything else; the world is as it was
};

/// `detail` is one sentence for the user: what was wrong, the offending value, the accepted range.
struct Error {
  ErrorCode code = ErrorCode::kFailed;
  std::string detail;
};

template <class T>
class [[nodiscard]] Result {
 public:
  Result(T value) : held_(std::move(value)) {}  // NOLINT: implicit on purpose, `return value;`
  Result(Error error) : held_(std::move(error)) {}  // NOLINT

  bool ok() const { return std::holds_alternative<T>(held_); }
  explicit operator bool() const { return ok(); }

  T& value() {
    assert(ok());
    return std::get<T>(held_);
  }
  const T& value() const {
    assert(ok());
    return std::get<T>(held_);
  }
  T& operator*() { return value(); }
  const T& operator*() const { return value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }

  const Error& error() const {
    assert(!ok());
    return std::get<Error>(held_);
  }

 private:
  std::variant<T, Error> held_;
};

/// A Result without a value.
struct Done {};
using Status = Result<Done>;

}  // namespace meshless
