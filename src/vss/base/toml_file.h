// TOML files as plain data: every value knows its file, line and name, so that an error can say where it
// stands.
#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "vss/base/result.h"

namespace vss {

// A value of a TOML file: a table, an array, a text, a number or a bool (dates are kept as texts).
// The getters return the value, or one sentence that names file, line, the value's name and what is needed.
class TomlValue {
 public:
  using Table = std::vector<std::pair<std::string, TomlValue>>;  // in the order of the names
  using Array = std::vector<TomlValue>;

  // The value of that name, or null. Null too where this is no table.
  const TomlValue* Find(std::string_view name) const;
  // The value of that name. `example`: what the missing line may look like.
  Result<const TomlValue*> Get(std::string_view name, std::string_view example) const;

  Result<const Table*> AsTable() const;
  Result<const Array*> AsArray() const;  // with at least one item
  Result<std::string> AsText() const;    // not empty, no control characters
  Result<double> AsNumber() const;       // finite
  Result<int> AsInteger(int min, int max) const;
  Result<double> AsNumberOrBool() const;             // false: 0, true: 1
  Result<std::vector<std::string>> AsTexts() const;  // at least one
  Result<std::vector<double>> AsNumbers() const;     // may be empty
  Result<Eigen::VectorXd> AsVector(int size) const;
  Result<Eigen::MatrixXd> AsMatrix(int rows, int columns) const;  // an array of rows

  bool IsTable() const { return std::holds_alternative<Table>(value_); }
  bool IsText() const { return std::holds_alternative<std::string>(value_); }
  const std::string& name() const { return name_; }
  int line() const { return line_; }
  std::string Where() const { return fmt::format("{}:{}", *file_, line_); }  // FILE:LINE
  // "FILE:LINE: `name` <what>"
  tl::unexpected<Error> Complain(std::string_view what) const;

 private:
  friend struct TomlConversion;
  std::variant<std::string, double, bool, Array, Table> value_;
  bool is_integer_ = false;
  std::string name_;  // as a reader would say it: "image 3, camera"
  int line_ = 1;
  std::shared_ptr<const std::string> file_;
};

// Reads a file whose top says `format = "<format>"`; another format, or none, is an error.
Result<TomlValue> ReadToml(const std::filesystem::path& path, std::string_view format);
// The same from a text; `file` is what messages call it.
Result<TomlValue> ParseToml(std::string_view text, const std::string& file, std::string_view format);

// Pieces of a TOML file as text: what is written reads back to the same bits.
std::string TomlNumber(double value);
std::string TomlText(std::string_view text);
std::string TomlArray(const Eigen::Ref<const Eigen::VectorXd>& values);
std::string TomlMatrix(const Eigen::Ref<const Eigen::MatrixXd>& matrix);

}  // namespace vss
