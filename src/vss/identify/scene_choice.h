// Which of the items stand in the scene: the set that together explains most with the fewest parts.
#pragma once
#include <map>
#include <vector>

#include "vss/identify/ledger.h"
#include "vss/identify/scene_data.h"

namespace vss {

// Two readings of the same lines whose log-odds differ by less are about as good as each other.
inline constexpr double kBarely = 10;

// What an object's relations to others can bring at most, log-odds.
double MostOfRelations(const ObjectModel& model);

class SceneChoice {
 public:
  // `data` must outlive it.
  explicit SceneChoice(SceneData& data) : data_(data), ledger_(data.index) {}

  // Chooses: greedy, then each item that was left out is given the place of what is in its way, as long as
  // that explains more.
  void Select();
  // The items chosen, by index, ascending.
  const std::vector<int>& accepted() const { return accepted_; }

  // What would explain least less in the place of an accepted item.
  struct Rival {
    int item;
    double loss;  // log-odds
  };
  // Of another kind; null: none.
  const Rival* RivalOf(int accepted) const;
  // Takes out what so much is missed of that something of another kind stands there, with what stands on it,
  // and chooses anew without it, until there is none.
  void DropRefuted();

  // How much each of `items`, beside all of them, is spoken for.
  struct Verdict {
    double log_odds = 0;
    bool incomplete = false;  // more of it is missed than is usual
    bool refuted = false;     // than of any part that was there
    bool endless = false;     // neither end is found
  };
  std::vector<Verdict> Verdicts(const std::vector<int>& items);
  // Is there something that explains nearly as much in the place of the accepted item?
  bool IsContested(int accepted) const;

 private:
  // A set of items, supports before what they carry, and what it explains.
  struct Choice {
    std::vector<int> items;
    double total = 0;
  };
  void Enter();
  void Value(SceneItem& item);
  int EdgesInside(const SceneItem& item) const;
  bool HasRoundEdge(const SceneItem& item) const;
  bool StandsOnRefuted(int i) const;
  void MarkEndless(int item);
  bool Stands(const Ledger::Share& share, double relations) const;
  double Relations(int i, const std::vector<int>& items) const;
  double Total(const std::vector<int>& items);
  double TotalOfGroup(const std::vector<int>& items);
  std::vector<std::vector<int>> Independent(const std::vector<int>& items);
  bool ConflictsWithAny(const std::vector<int>& chain, const std::vector<int>& items);
  std::vector<int> MissingChain(int i, const std::vector<int>& items) const;
  void AddBestByTotal(std::vector<int> items, Choice& choice);
  void AddBest(const std::vector<int>& order, Choice& choice);
  Choice With(int i, const Choice& choice, const std::vector<int>& order, std::vector<int>& removed);
  Choice Replaced(int i, const Choice& choice, std::vector<int>& removed);
  bool Improve(const std::vector<int>& order, Choice& best);
  void NoteRival(int accepted, int rival, double loss);

  SceneData& data_;
  Ledger ledger_;
  std::map<std::vector<int>, double> totals_;  // of groups seen before, by their candidates
  std::vector<int> place_;                     // scratch of Independent()
  std::vector<int> accepted_;
  std::map<int, double> other_sizes_;  // of accepted items: what the least bad of another size would lose
  std::map<int, Rival> rivals_;        // of accepted items, of another kind
};

}  // namespace vss
