#include "store.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <thread>

namespace vss::station {
namespace fs = std::filesystem;
namespace {

class StoreTest : public testing::Test {
 protected:
  StoreTest()
      : folder_(fs::temp_directory_path() /
                fmt::format("vss-store-{}-{}", ::getpid(), testing::UnitTest::GetInstance()->random_seed())) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~StoreTest() override { fs::remove_all(folder_); }
  std::unique_ptr<Store> Open() { return std::move(Store::Open(folder_).value()); }
  fs::path folder_;
};

Change Set(const std::string& id, Json value, std::optional<std::int64_t> version = {}) {
  return {"part", id, std::move(value), version};
}

TEST_F(StoreTest, KeepsWhatWasAppliedAfterOpeningAgain) {
  Open()->Apply("ann", "add part-1", {Set("part-1", 7)}).value();
  const auto item = Open()->Get("part", "part-1");
  ASSERT_TRUE(item);
  EXPECT_EQ(*item->value, 7);
  EXPECT_EQ(item->version, 1);
}

TEST_F(StoreTest, UndoesAndRedoesEveryEditToTheFirst) {
  auto store = Open();
  for (int i = 1; i <= 50; ++i) store->Apply("ann", fmt::format("step {}", i), {Set("p", i)}).value();
  for (int i = 49; i >= 1; --i) {
    store->Undo("ann", {}).value();
    EXPECT_EQ(*store->Get("part", "p")->value, i);
  }
  store->Undo("ann", {}).value();
  EXPECT_FALSE(store->Get("part", "p"));
  EXPECT_EQ(store->Undo("ann", {}).error().why, StoreError::kNothingToDo);
  for (int i = 1; i <= 50; ++i) {
    store->Redo("ann", {}).value();
    EXPECT_EQ(*store->Get("part", "p")->value, i);
  }
  EXPECT_EQ(store->Redo("ann", {}).error().why, StoreError::kNothingToDo);
}

TEST_F(StoreTest, ANewEditEndsWhatCouldBeDoneAgain) {
  auto store = Open();
  store->Apply("ann", "one", {Set("p", 1)}).value();
  store->Apply("ann", "two", {Set("p", 2)}).value();
  store->Undo("ann", {}).value();
  store->Apply("ann", "three", {Set("p", 3)}).value();
  EXPECT_EQ(store->Redo("ann", {}).error().why, StoreError::kNothingToDo);
  store->Undo("ann", {}).value();
  EXPECT_EQ(*store->Get("part", "p")->value, 1);
}

TEST_F(StoreTest, RefusesAChangeToWhatSomebodyElseChanged) {
  auto store = Open();
  store->Apply("ann", "add", {Set("p", 1)}).value();
  const auto seen = store->Get("part", "p")->version;
  store->Apply("bob", "change", {Set("p", 2, seen)}).value();
  const auto refused = store->Apply("ann", "change", {Set("q", 1), Set("p", 3, seen)});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().why, StoreError::kConflict);
  EXPECT_EQ(*refused.error().present->value, 2);
  EXPECT_FALSE(store->Get("part", "q")) << "a refused edit must leave nothing behind";
  EXPECT_EQ(store->State().revision, 2);
}

TEST_F(StoreTest, RefusesToUndoAnotherEditThanTheOneSeen) {
  auto store = Open();
  store->Apply("ann", "one", {Set("p", 1)}).value();
  const auto seen = store->State().undo_edit;
  store->Apply("bob", "two", {Set("p", 2)}).value();
  EXPECT_EQ(store->Undo("ann", seen).error().why, StoreError::kConflict);
  EXPECT_EQ(*store->Get("part", "p")->value, 2);
}

TEST_F(StoreTest, TellsWhoDidWhatAndWhen) {
  auto store = Open();
  store->Apply("ann", "add the tee", {Set("p", 1)}).value();
  store->Undo("bob", {}).value();
  const auto rows = store->History(0, 10);
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[0].action, "undo");
  EXPECT_EQ(rows[0].who, "bob");
  EXPECT_EQ(rows[0].label, "add the tee");
  EXPECT_EQ(rows[1].who, "ann");
  EXPECT_EQ(rows[1].when.size(), 24u);
}

TEST_F(StoreTest, TellsWhatChangedSinceARevisionDeletionsIncluded) {
  auto store = Open();
  store->Apply("ann", "add", {Set("p", 1), Set("q", 1)}).value();
  store->Apply("ann", "delete", {{"part", "p", std::nullopt, {}}}).value();
  const auto items = store->Since(1);
  ASSERT_EQ(items.size(), 1u);
  EXPECT_EQ(items[0].id, "p");
  EXPECT_FALSE(items[0].value);
  EXPECT_EQ(store->List("part").size(), 1u);
}

TEST_F(StoreTest, RefusesAFolderThatAnotherStationHasOpen) {
  auto store = Open();
  const auto second = Store::Open(folder_);
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().message.find("another station"), std::string::npos);
}

TEST_F(StoreTest, SaysWhatToDoWithADamagedFile) {
  std::ofstream(folder_ / "station.sqlite") << std::string(5000, 'x');
  const auto store = Store::Open(folder_);
  ASSERT_FALSE(store);
  EXPECT_NE(store.error().message.find("move it aside"), std::string::npos) << store.error().message;
}

// A child confirms every edit through a pipe before it makes the next; it is killed at moments that differ.
TEST_F(StoreTest, LosesNothingThatItConfirmedWhenItIsKilled) {
  std::int64_t last = 0;
  for (int round = 0; round < 12; ++round) {
    int ends[2];
    ASSERT_EQ(::pipe(ends), 0);
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      auto store = std::move(Store::Open(folder_).value());
      for (;;) {
        const std::int64_t revision =
            store->Apply("ann", "edit", {Set("p", store->State().revision + 1)}).value();
        if (::write(ends[1], &revision, sizeof revision) != sizeof revision) ::_exit(1);
      }
    }
    ::close(ends[1]);
    std::int64_t confirmed = last;
    for (int i = 0; i < 3 + round; ++i)
      ASSERT_EQ(::read(ends[0], &confirmed, sizeof confirmed), ssize_t(sizeof confirmed));
    std::this_thread::sleep_for(std::chrono::microseconds(137 * round));
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
    for (std::int64_t more; ::read(ends[0], &more, sizeof more) == ssize_t(sizeof more);) confirmed = more;
    ::close(ends[0]);
    auto store = Open();
    EXPECT_GE(store->State().revision, confirmed);
    EXPECT_EQ(*store->Get("part", "p")->value, store->State().revision);
    last = store->State().revision;
  }
}

}  // namespace
}  // namespace vss::station
