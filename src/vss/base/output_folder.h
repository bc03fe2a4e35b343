// A folder of results that appears whole: files are kept until all are there, then written beside their
// places and renamed.
#pragma once
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "vss/base/result.h"

namespace vss {

class OutputFolder {
 public:
  // Makes the folder and checks that it can be written to, before any work is done.
  static Result<OutputFolder> Open(const std::filesystem::path& folder);
  OutputFolder(OutputFolder&& other) noexcept;
  OutputFolder& operator=(OutputFolder&&) = delete;
  // Without a Commit the folders that Open made go again.
  ~OutputFolder();

  // `name`: relative, may contain folders.
  void Add(const std::filesystem::path& name, std::string content);
  // Writes all files, or, where one cannot be written, none.
  Status Commit();
  const std::filesystem::path& path() const { return folder_; }

 private:
  OutputFolder() = default;
  std::filesystem::path folder_;
  std::vector<std::filesystem::path> made_;  // folders that did not exist before, outermost first
  std::vector<std::pair<std::filesystem::path, std::string>> files_;
};

// A name for each picture's results: the file's name without its ending; where two pictures would share one,
// their whole path with '_' for what separates folders.
std::vector<std::string> OutputNames(const std::vector<std::string>& picture_files);

}  // namespace vss
