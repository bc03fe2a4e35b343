#include "store.h"

#include <fcntl.h>
#include <sqlite3.h>
#include <sys/file.h>
#include <sys/vfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <ctime>
#include <mutex>
#include <stdexcept>

namespace vss::station {
namespace {

constexpr int kSchemaVersion = 1;

// A failure of SQLite on its way out of this file, where it becomes a StoreError.
struct SqlFailure : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class Statement {
 public:
  Statement(sqlite3* db, const char* sql) : db_(db) {
    if (sqlite3_prepare_v2(db, sql, -1, &statement_, nullptr) != SQLITE_OK)
      throw SqlFailure(sqlite3_errmsg(db));
  }
  ~Statement() { sqlite3_finalize(statement_); }
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;
  Statement& Bind(std::int64_t value) {
    Check(sqlite3_bind_int64(statement_, ++bound_, value));
    return *this;
  }
  Statement& Bind(const std::string& value) {
    Check(sqlite3_bind_text(statement_, ++bound_, value.data(), static_cast<int>(value.size()),
                            SQLITE_TRANSIENT));
    return *this;
  }
  Statement& Bind(const std::optional<Json>& value) {
    if (value) return Bind(value->dump());
    Check(sqlite3_bind_null(statement_, ++bound_));
    return *this;
  }
  bool Step() {
    const int code = sqlite3_step(statement_);
    if (code != SQLITE_ROW && code != SQLITE_DONE) throw SqlFailure(sqlite3_errmsg(db_));
    return code == SQLITE_ROW;
  }
  std::int64_t Int(int column) const { return sqlite3_column_int64(statement_, column); }
  std::string Text(int column) const {
    const auto* text = sqlite3_column_text(statement_, column);
    return text ? std::string(reinterpret_cast<const char*>(text),
                              std::size_t(sqlite3_column_bytes(statement_, column)))
                : "";
  }
  std::optional<Json> Value(int column) const {
    if (sqlite3_column_type(statement_, column) == SQLITE_NULL) return std::nullopt;
    return Json::parse(Text(column));
  }

 private:
  void Check(int code) {
    if (code != SQLITE_OK) throw SqlFailure(sqlite3_errmsg(db_));
  }
  sqlite3* db_;
  sqlite3_stmt* statement_ = nullptr;
  int bound_ = 0;
};

void Execute(sqlite3* db, const char* sql) {
  if (sqlite3_exec(db, sql, nullptr, nullptr, nullptr) != SQLITE_OK) throw SqlFailure(sqlite3_errmsg(db));
}

// Rolls back unless committed.
class Transaction {
 public:
  explicit Transaction(sqlite3* db) : db_(db) { Execute(db, "BEGIN IMMEDIATE"); }
  ~Transaction() {
    if (!done_) sqlite3_exec(db_, "ROLLBACK", nullptr, nullptr, nullptr);
  }
  void Commit() {
    Execute(db_, "COMMIT");
    done_ = true;
  }

 private:
  sqlite3* db_;
  bool done_ = false;
};

constexpr const char* kSchema = R"(
CREATE TABLE IF NOT EXISTS item(kind TEXT NOT NULL, id TEXT NOT NULL, value TEXT, version INTEGER NOT NULL,
                                PRIMARY KEY(kind, id)) WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS item_version ON item(version);
CREATE TABLE IF NOT EXISTS edit(edit INTEGER PRIMARY KEY AUTOINCREMENT, label TEXT NOT NULL,
                                state TEXT NOT NULL CHECK(state IN ('done', 'undone', 'dropped')));
CREATE INDEX IF NOT EXISTS edit_state ON edit(state, edit);
CREATE TABLE IF NOT EXISTS difference(edit INTEGER NOT NULL REFERENCES edit(edit), kind TEXT NOT NULL, id TEXT NOT NULL,
                                      before TEXT, after TEXT, PRIMARY KEY(edit, kind, id)) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS history(revision INTEGER PRIMARY KEY, edit INTEGER NOT NULL REFERENCES edit(edit),
                                   action TEXT NOT NULL, who TEXT NOT NULL, at TEXT NOT NULL);
)";

std::string Now() {
  const auto now = std::chrono::system_clock::now();
  const std::time_t t = std::chrono::system_clock::to_time_t(now);
  const auto ms =
      std::chrono::duration_cast<std::chrono::milliseconds>(now.time_since_epoch()).count() % 1000;
  std::tm utc{};
  gmtime_r(&t, &utc);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%S", &utc);
  return fmt::format("{}.{:03d}Z", text, ms);
}

// Magic numbers of statfs(2) for file systems that live on another machine.
bool IsNetworkFileSystem(const std::filesystem::path& folder) {
  struct statfs info {};
  if (::statfs(folder.c_str(), &info) != 0) return false;
  const auto type = static_cast<std::uint32_t>(info.f_type);
  const std::uint32_t network[] = {
      0x6969 /* NFS */,     0x517b /* SMB */,      0xfe534d42 /* SMB2 */, 0xff534d42 /* CIFS */,
      0x5346414f /* AFS */, 0x00c36400 /* Ceph */, 0x01021997 /* 9P */,   0x0bd00bd0 /* Lustre */};
  return std::find(std::begin(network), std::end(network), type) != std::end(network);
}

tl::unexpected<StoreError> Failed(const std::exception& e) {
  return tl::unexpected<StoreError>(
      {StoreError::kFailed,
       fmt::format("the survey's edits cannot be saved ({}); free some space and check the disk", e.what()),
       {}});
}

}  // namespace

struct Store::Impl {
  sqlite3* db = nullptr;
  int lock = -1;
  mutable std::mutex mutex;

  ~Impl() {
    if (db) sqlite3_close(db);
    if (lock >= 0) ::close(lock);
  }

  std::int64_t Revision() const {
    Statement s(db, "SELECT coalesce(max(revision), 0) FROM history");
    s.Step();
    return s.Int(0);
  }

  std::optional<Item> Find(const std::string& kind, const std::string& id) const {
    Statement s(db, "SELECT value, version FROM item WHERE kind = ? AND id = ?");
    if (!s.Bind(kind).Bind(id).Step()) return std::nullopt;
    return Item{kind, id, s.Value(0), s.Int(1)};
  }

  void Put(const std::string& kind, const std::string& id, const std::optional<Json>& value,
           std::int64_t revision) {
    Statement(db,
              "INSERT INTO item(kind, id, value, version) VALUES(?, ?, ?, ?) "
              "ON CONFLICT(kind, id) DO UPDATE SET value = excluded.value, version = excluded.version")
        .Bind(kind)
        .Bind(id)
        .Bind(value)
        .Bind(revision)
        .Step();
  }

  void Note(std::int64_t revision, std::int64_t edit, const std::string& action, const std::string& who) {
    Statement(db, "INSERT INTO history(revision, edit, action, who, at) VALUES(?, ?, ?, ?, ?)")
        .Bind(revision)
        .Bind(edit)
        .Bind(action)
        .Bind(who)
        .Bind(Now())
        .Step();
  }

  std::vector<Difference> Differences(std::int64_t edit) const {
    std::vector<Difference> out;
    Statement s(db, "SELECT kind, id, before, after FROM difference WHERE edit = ? ORDER BY kind, id");
    s.Bind(edit);
    while (s.Step()) out.push_back({s.Text(0), s.Text(1), s.Value(2), s.Value(3)});
    return out;
  }

  // The edit that undo (newest done) or redo (oldest undone) would take.
  std::pair<std::int64_t, std::string> Next(bool undo) const {
    Statement s(db, undo ? "SELECT edit, label FROM edit WHERE state = 'done' ORDER BY edit DESC LIMIT 1"
                         : "SELECT edit, label FROM edit WHERE state = 'undone' ORDER BY edit LIMIT 1");
    if (!s.Step()) return {0, ""};
    return {s.Int(0), s.Text(1)};
  }

  StoreResult<std::int64_t> Travel(const std::string& who, std::optional<std::int64_t> seen, bool undo) {
    std::lock_guard guard(mutex);
    try {
      Transaction transaction(db);
      const auto [edit, label] = Next(undo);
      if (edit == 0)
        return tl::unexpected<StoreError>({StoreError::kNothingToDo,
                                           undo ? "there is nothing to undo" : "there is nothing to do again",
                                           {}});
      if (seen && *seen != edit)
        return tl::unexpected<StoreError>(
            {StoreError::kConflict,
             fmt::format("somebody else was faster: the next to {} is now \"{}\"", undo ? "undo" : "do again",
                         label),
             {}});
      const std::int64_t revision = Revision() + 1;
      for (const auto& d : Differences(edit)) Put(d.kind, d.id, undo ? d.before : d.after, revision);
      Statement(db, "UPDATE edit SET state = ? WHERE edit = ?")
          .Bind(std::string(undo ? "undone" : "done"))
          .Bind(edit)
          .Step();
      Note(revision, edit, undo ? "undo" : "redo", who);
      transaction.Commit();
      return revision;
    } catch (const std::exception& e) {
      return Failed(e);
    }
  }
};

Store::Store(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Store::~Store() = default;

Result<std::unique_ptr<Store>> Store::Open(const std::filesystem::path& folder) {
  if (IsNetworkFileSystem(folder))
    return InputError(
        "{}: this folder lies on a network file system, whose locks cannot be trusted; copy the survey to a "
        "local disk",
        folder.string());
  auto impl = std::make_unique<Impl>();
  const std::string lock = (folder / "station.lock").string();
  impl->lock = ::open(lock.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0644);
  if (impl->lock < 0)
    return InputError(
        "{}: the station keeps its edits in the survey's folder and cannot write there ({}); copy the survey "
        "to a folder of yours",
        folder.string(), std::strerror(errno));
  if (::flock(impl->lock, LOCK_EX | LOCK_NB) != 0)
    return InputError("{}: another station has this survey open; use its page, or stop it first",
                      folder.string());
  const std::string path = (folder / "station.sqlite").string();
  try {
    if (sqlite3_open_v2(path.c_str(), &impl->db,
                        SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_FULLMUTEX,
                        nullptr) != SQLITE_OK)
      throw SqlFailure(impl->db ? sqlite3_errmsg(impl->db) : "out of memory");
    sqlite3_busy_timeout(impl->db, 2000);
    Execute(impl->db, "PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL; PRAGMA foreign_keys = ON;");
    Statement version(impl->db, "PRAGMA user_version");
    version.Step();
    if (version.Int(0) > kSchemaVersion)
      return InputError("{}: a newer VSS wrote this file (version {}, this program knows {}); use that one",
                        path, version.Int(0), kSchemaVersion);
    Execute(impl->db, kSchema);
    Execute(impl->db, fmt::format("PRAGMA user_version = {}", kSchemaVersion).c_str());
  } catch (const std::exception& e) {
    return InputError(
        "{}: the station's file of edits cannot be opened ({}); move it aside to start afresh, or put back a "
        "copy",
        path, e.what());
  }
  return std::unique_ptr<Store>(new Store(std::move(impl)));
}

StoreResult<std::int64_t> Store::Apply(const std::string& who, const std::string& label,
                                       const std::vector<Change>& changes) {
  std::lock_guard guard(impl_->mutex);
  sqlite3* db = impl_->db;
  try {
    Transaction transaction(db);
    const std::int64_t revision = impl_->Revision() + 1;
    Statement(db, "UPDATE edit SET state = 'dropped' WHERE state = 'undone'").Step();
    Statement(db, "INSERT INTO edit(label, state) VALUES(?, 'done')").Bind(label).Step();
    const std::int64_t edit = sqlite3_last_insert_rowid(db);
    for (const auto& change : changes) {
      const Item now =
          impl_->Find(change.kind, change.id).value_or(Item{change.kind, change.id, std::nullopt, 0});
      if (change.version && *change.version != now.version && (*change.version != 0 || now.value))
        return tl::unexpected<StoreError>(
            {StoreError::kConflict,
             fmt::format("somebody else changed {} {} in the meantime; look at it and try again", change.kind,
                         change.id),
             now});
      Statement(db,
                "INSERT INTO difference(edit, kind, id, before, after) VALUES(?, ?, ?, ?, ?) "
                "ON CONFLICT(edit, kind, id) DO UPDATE SET after = excluded.after")
          .Bind(edit)
          .Bind(change.kind)
          .Bind(change.id)
          .Bind(now.value)
          .Bind(change.value)
          .Step();
      impl_->Put(change.kind, change.id, change.value, revision);
    }
    impl_->Note(revision, edit, "edit", who);
    transaction.Commit();
    return revision;
  } catch (const std::exception& e) {
    return Failed(e);
  }
}

StoreResult<std::int64_t> Store::Undo(const std::string& who, std::optional<std::int64_t> seen) {
  return impl_->Travel(who, seen, true);
}
StoreResult<std::int64_t> Store::Redo(const std::string& who, std::optional<std::int64_t> seen) {
  return impl_->Travel(who, seen, false);
}

std::int64_t Store::Revision() const {
  std::lock_guard guard(impl_->mutex);
  return impl_->Revision();
}

std::optional<Item> Store::Get(const std::string& kind, const std::string& id) const {
  std::lock_guard guard(impl_->mutex);
  auto item = impl_->Find(kind, id);
  return item && item->value ? item : std::nullopt;
}

std::int64_t Store::Version(const std::string& kind, const std::string& id) const {
  std::lock_guard guard(impl_->mutex);
  Statement s(impl_->db, "SELECT version FROM item WHERE kind = ? AND id = ?");
  return s.Bind(kind).Bind(id).Step() ? s.Int(0) : 0;
}

std::vector<Item> Store::List(const std::string& kind) const {
  std::lock_guard guard(impl_->mutex);
  std::vector<Item> out;
  Statement s(impl_->db,
              "SELECT id, value, version FROM item WHERE kind = ? AND value IS NOT NULL ORDER BY id");
  s.Bind(kind);
  while (s.Step()) out.push_back({kind, s.Text(0), s.Value(1), s.Int(2)});
  return out;
}

std::vector<Item> Store::Since(std::int64_t revision) const {
  std::lock_guard guard(impl_->mutex);
  std::vector<Item> out;
  Statement s(impl_->db, "SELECT kind, id, value, version FROM item WHERE version > ? ORDER BY kind, id");
  s.Bind(revision);
  while (s.Step()) out.push_back({s.Text(0), s.Text(1), s.Value(2), s.Int(3)});
  return out;
}

UndoState Store::State() const {
  std::lock_guard guard(impl_->mutex);
  UndoState state;
  state.revision = impl_->Revision();
  std::tie(state.undo_edit, state.undo_label) = impl_->Next(true);
  std::tie(state.redo_edit, state.redo_label) = impl_->Next(false);
  return state;
}

std::vector<HistoryRow> Store::History(std::int64_t before_revision, int limit) const {
  std::lock_guard guard(impl_->mutex);
  std::vector<HistoryRow> out;
  Statement s(
      impl_->db,
      "SELECT h.revision, h.edit, h.action, h.who, h.at, e.label FROM history h JOIN edit e USING(edit) "
      "WHERE ?1 = 0 OR h.revision < ?1 ORDER BY h.revision DESC LIMIT ?2");
  s.Bind(before_revision).Bind(limit);
  while (s.Step()) out.push_back({s.Int(0), s.Int(1), s.Text(2), s.Text(3), s.Text(4), s.Text(5)});
  return out;
}

std::vector<Difference> Store::DifferencesOf(std::int64_t edit) const {
  std::lock_guard guard(impl_->mutex);
  return impl_->Differences(edit);
}

}  // namespace vss::station
