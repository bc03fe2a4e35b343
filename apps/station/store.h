// What the operator did to a survey, in one SQLite file in the survey's folder: the present state, every edit
// with who and when, and undo and redo without limit. An edit that Apply has confirmed survives a power cut.
//
// The state is a set of items, each a JSON value with a kind and an id. `version` of an item is the revision
// at which it changed last; a change names the version that its author saw, and is refused where somebody
// changed the item since.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "vss/base/result.h"

namespace vss::station {

using Json = nlohmann::json;

struct Item {
  std::string kind, id;
  std::optional<Json> value;  // empty: deleted
  std::int64_t version = 0;   // 0: has never been there
};

struct Change {
  std::string kind, id;
  std::optional<Json> value;            // empty: delete
  std::optional<std::int64_t> version;  // that the author saw; empty: whatever is there
};

struct HistoryRow {
  std::int64_t revision = 0;  // grows by one with every edit, undo and redo
  std::int64_t edit = 0;      // the edit that was made, undone or done again
  std::string action;         // "edit", "undo" or "redo"
  std::string who, when, label;
};

// One item before and after.
struct Difference {
  std::string kind, id;
  std::optional<Json> before, after;
};

struct StoreError {
  enum Why { kConflict, kNothingToDo, kFailed } why = kFailed;
  std::string message;
  std::optional<Item> present;  // kConflict: what is there now
};
template <class T>
using StoreResult = tl::expected<T, StoreError>;

struct UndoState {
  std::int64_t revision = 0;
  std::int64_t undo_edit = 0, redo_edit = 0;  // 0: none
  std::string undo_label, redo_label;
};

class Store {
 public:
  // Opens or makes `folder`/station.sqlite. Refuses a network file system (its locks cannot be trusted), a
  // folder that another station has open, and a file that is damaged or newer than this program.
  static Result<std::unique_ptr<Store>> Open(const std::filesystem::path& folder);
  ~Store();
  Store(const Store&) = delete;
  Store& operator=(const Store&) = delete;

  // All changes or none. Returns the new revision.
  StoreResult<std::int64_t> Apply(const std::string& who, const std::string& label,
                                  const std::vector<Change>& changes);
  // `seen_edit`: the edit that the author believes he undoes or does again; refused where it is another one
  // by now.
  StoreResult<std::int64_t> Undo(const std::string& who, std::optional<std::int64_t> seen_edit);
  StoreResult<std::int64_t> Redo(const std::string& who, std::optional<std::int64_t> seen_edit);

  std::int64_t Revision() const;  // of the newest edit, undo or redo; 0: none yet
  std::optional<Item> Get(const std::string& kind, const std::string& id) const;
  // The revision at which the item changed last, deleted ones included; 0: never.
  std::int64_t Version(const std::string& kind, const std::string& id) const;
  // Items of that kind that are there, by id.
  std::vector<Item> List(const std::string& kind) const;
  // Items that changed after `revision`, deleted ones included.
  std::vector<Item> Since(std::int64_t revision) const;
  UndoState State() const;
  // Newest first, before `before_revision` (0: from the end).
  std::vector<HistoryRow> History(std::int64_t before_revision, int limit) const;
  std::vector<Difference> DifferencesOf(std::int64_t edit) const;

 private:
  struct Impl;
  explicit Store(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace vss::station
