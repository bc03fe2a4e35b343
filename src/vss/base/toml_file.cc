#include "vss/base/toml_file.h"

#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <sstream>

#include "vss/base/files.h"

namespace vss {

// Turns toml++'s tree into ours, names and lines included.
struct TomlConversion {
  std::shared_ptr<const std::string> file;

  TomlValue Convert(const toml::node& node, std::string name, int parent_line) const {
    TomlValue out;
    out.file_ = file;
    out.name_ = std::move(name);
    out.line_ = node.source().begin.line > 0 ? int(node.source().begin.line) : parent_line;
    if (const auto* table = node.as_table()) {
      out.value_ = Table(*table, out);
    } else if (const auto* array = node.as_array()) {
      out.value_ = Array(*array, out);
    } else if (const auto* text = node.as_string()) {
      out.value_ = text->get();
    } else if (const auto* integer = node.as_integer()) {
      out.value_ = static_cast<double>(integer->get());
      out.is_integer_ = true;
    } else if (const auto* number = node.as_floating_point()) {
      out.value_ = number->get();
    } else if (const auto* yes = node.as_boolean()) {
      out.value_ = yes->get();
    } else {
      std::ostringstream text_of_date;
      node.visit([&](const auto& n) {
        if constexpr (toml::is_date<decltype(n)> || toml::is_time<decltype(n)> ||
                      toml::is_date_time<decltype(n)>)
          text_of_date << n.get();
      });
      out.value_ = text_of_date.str();
    }
    return out;
  }

  TomlValue::Table Table(const toml::table& table, const TomlValue& parent) const {
    TomlValue::Table out;
    for (const auto& [key, node] : table) {
      const std::string own(key.str());
      TomlValue value = Convert(node, parent.name_.empty() ? own : parent.name_ + "." + own, parent.line_);
      if (!value.IsTable() && key.source().begin.line > 0) value.line_ = int(key.source().begin.line);
      out.emplace_back(own, std::move(value));
    }
    return out;
  }

  TomlValue::Array Array(const toml::array& array, const TomlValue& parent) const {
    TomlValue::Array out;
    for (const auto& node : array)
      out.push_back(Convert(node, fmt::format("{}[{}]", parent.name_, out.size() + 1), parent.line_));
    return out;
  }
};

namespace {

bool HasControlCharacter(std::string_view text) {
  return std::any_of(text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; });
}

}  // namespace

tl::unexpected<Error> TomlValue::Complain(std::string_view what) const {
  if (name_.empty()) return InputError("{}: {}", Where(), what);
  return InputError("{}: `{}` {}", Where(), name_, what);
}

const TomlValue* TomlValue::Find(std::string_view name) const {
  const auto* table = std::get_if<Table>(&value_);
  if (!table) return nullptr;
  const auto found =
      std::find_if(table->begin(), table->end(), [&](const auto& row) { return row.first == name; });
  return found == table->end() ? nullptr : &found->second;
}

Result<const TomlValue*> TomlValue::Get(std::string_view name, std::string_view example) const {
  if (!IsTable()) return Complain("is no table");
  if (const TomlValue* value = Find(name)) return value;
  return InputError("{}: `{}` is missing{}; add a line like: {}", Where(), name,
                    name_.empty() ? "" : " in " + name_, example);
}

Result<const TomlValue::Table*> TomlValue::AsTable() const {
  if (const auto* table = std::get_if<Table>(&value_)) return table;
  return Complain(fmt::format("must be a table; write it as [{}]", name_));
}

Result<const TomlValue::Array*> TomlValue::AsArray() const {
  const auto* array = std::get_if<Array>(&value_);
  if (!array) return Complain("must be a list in brackets");
  if (array->empty()) return Complain("is an empty list; give at least one entry");
  return array;
}

Result<std::string> TomlValue::AsText() const {
  const auto* text = std::get_if<std::string>(&value_);
  if (!text) return Complain("must be a text in quotes");
  if (text->empty()) return Complain("is an empty text; fill it in");
  if (HasControlCharacter(*text)) return Complain("contains control characters; take them out");
  return *text;
}

Result<double> TomlValue::AsNumber() const {
  const auto* number = std::get_if<double>(&value_);
  if (!number) return Complain("must be a number");
  if (!std::isfinite(*number)) return Complain("is not a finite number; correct it");
  return *number;
}

Result<int> TomlValue::AsInteger(int min, int max) const {
  const auto* number = std::get_if<double>(&value_);
  if (!number || !is_integer_ || *number < min || *number > max)
    return Complain(fmt::format("must be a whole number from {} to {}", min, max));
  return static_cast<int>(*number);
}

Result<double> TomlValue::AsNumberOrBool() const {
  if (const auto* yes = std::get_if<bool>(&value_)) return *yes ? 1.0 : 0.0;
  if (!std::holds_alternative<double>(value_)) return Complain("must be a number, true or false");
  return AsNumber();
}

Result<std::vector<std::string>> TomlValue::AsTexts() const {
  VSS_ASSIGN(const Array* array, AsArray());
  std::vector<std::string> texts;
  for (const auto& item : *array) {
    VSS_ASSIGN(texts.emplace_back(), item.AsText());
  }
  return texts;
}

Result<std::vector<double>> TomlValue::AsNumbers() const {
  const auto* array = std::get_if<Array>(&value_);
  if (!array) return Complain("must be a list of numbers in brackets");
  std::vector<double> numbers;
  for (const auto& item : *array) {
    VSS_ASSIGN(numbers.emplace_back(), item.AsNumber());
  }
  return numbers;
}

Result<Eigen::VectorXd> TomlValue::AsVector(int size) const {
  VSS_ASSIGN(const std::vector<double> numbers, AsNumbers());
  if (static_cast<int>(numbers.size()) != size)
    return Complain(fmt::format("must have {} numbers, it has {}", size, numbers.size()));
  return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(numbers.data(), size));
}

Result<Eigen::MatrixXd> TomlValue::AsMatrix(int rows, int columns) const {
  const auto* array = std::get_if<Array>(&value_);
  if (!array || static_cast<int>(array->size()) != rows)
    return Complain(fmt::format("must be a list of {} rows with {} numbers each", rows, columns));
  Eigen::MatrixXd matrix(rows, columns);
  for (int i = 0; i < rows; ++i) {
    VSS_ASSIGN(matrix.row(i), (*array)[std::size_t(i)].AsVector(columns));
  }
  return matrix;
}

Result<TomlValue> ParseToml(std::string_view text, const std::string& file, std::string_view format) {
  TomlConversion conversion{std::make_shared<const std::string>(file)};
  TomlValue root;
  try {
    const toml::table table = toml::parse(text, file);
    root = conversion.Convert(table, "", 1);
  } catch (const toml::parse_error& e) {
    return InputError("{}:{}:{}: not valid TOML: {}", file, e.source().begin.line, e.source().begin.column,
                      e.description());
  }
  const TomlValue* given = root.Find("format");
  if (!given)
    return InputError("{}:1: `format` is missing; a file of this kind begins with: format = \"{}\"", file,
                      format);
  VSS_ASSIGN(const std::string name, given->AsText());
  if (name != format)
    return InputError(
        "{}: `format` is \"{}\", but \"{}\" is needed here; name another file or convert this one",
        given->Where(), name, format);
  return root;
}

Result<TomlValue> ReadToml(const std::filesystem::path& path, std::string_view format) {
  VSS_ASSIGN(const std::string text, ReadTextFile(path, 16 << 20));
  return ParseToml(text, path.string(), format);
}

std::string TomlNumber(double value) {
  std::string text = fmt::format("{}", value);
  if (text.find_first_not_of("-0123456789") == std::string::npos) text += ".0";
  return text;
}

std::string TomlText(std::string_view text) {
  std::string out = "\"";
  for (const unsigned char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    if (c < 0x20 || c == 0x7f)
      out += fmt::format("\\u{:04X}", c);
    else
      out += static_cast<char>(c);
  }
  return out + '"';
}

std::string TomlArray(const Eigen::Ref<const Eigen::VectorXd>& values) {
  std::string out = "[";
  for (Eigen::Index i = 0; i < values.size(); ++i) out += (i ? ", " : "") + TomlNumber(values[i]);
  return out + "]";
}

std::string TomlMatrix(const Eigen::Ref<const Eigen::MatrixXd>& matrix) {
  std::string out = "[";
  for (Eigen::Index i = 0; i < matrix.rows(); ++i)
    out += (i ? ", " : "") + TomlArray(matrix.row(i).transpose());
  return out + "]";
}

}  // namespace vss
