// The file of a node's autosave. As long as a process has it, no other one takes it up, writes or removes it.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/io/file_lock.h"
#include "meshless_surgery/io/session_folder.h"
#include "meshless_surgery/world/saved_world.h"

namespace meshless {

/// How the names of autosaves begin.
inline const std::string kAutosavePrefix = "autosave_";

/// Of the autosave of the node with that name ("/station/deformer"); no two nodes have the same one.
std::string autosaveNameOf(const std::string& node_name);

class AutosaveFile {
 public:
  AutosaveFile(const SessionFolder& folder, std::string name) : folder_(folder), base_(std::move(name)), name_(base_) {}
  ~AutosaveFile() { giveBack(); }

  using Say = std::function<void(const std::string&)>;
  /// Takes possession of a file: of `name`, or where another process has that one for longer than `patience`, of
  /// name.2, name.3 ...; the state in it, if one of the same origin was left there by a process that was killed. A
  /// state that is not taken up is set aside. What is out of the ordinary is said. Refuses (kFailed) where the folder
  /// cannot be written.
  Result<SavedWorldPtr> claim(const std::string& origin, std::chrono::milliseconds patience, const Say& say);
  /// From here on whoever is killed has been at work with the state: until then claim leaves no traces.
  void keep() { kept_ = true; }

  /// As SessionFolder::write.
  Status write(std::string_view bytes);
  /// Removes what this process has written or taken up, and nothing else; gives the name back.
  void remove();

 private:
  struct FileId {  // of one that was written: each has its own
    ino_t inode = 0;
    std::int64_t changed = 0;  // [ns]
    bool operator==(const FileId& other) const { return inode == other.inode && changed == other.changed; }
  };
  struct Note {  // in the lock's file
    long process = 0;
    int times_taken_up = 0;
    FileId file;
  };

  Result<bool> tryName(int number);
  bool findOwn(const std::string& origin);
  Status takeName(std::chrono::milliseconds patience, const Say& say);
  Result<SavedWorldPtr> readState(const std::string& name, const std::string& origin) const;
  Result<SavedWorldPtr> takeUp(const std::string& origin, const Say& say);
  Result<std::string> setAside() const;
  void giveBack();
  std::string numbered(int number) const;
  std::string lockPath(const std::string& name) const { return folder_.folder() + "/." + name + ".lock"; }
  std::optional<FileId> idOf(const std::string& name) const;
  static Note parse(const std::string& text);
  void note(int times_taken_up, const FileId& file) const;

  const SessionFolder& folder_;
  const std::string base_;
  std::string name_;  // the one in use
  FileLock lock_;
  std::optional<FileId> own_;
  Note before_;  // as it was found
  bool kept_ = false;
};

}  // namespace meshless
