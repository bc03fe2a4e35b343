#include "station.h"

#include <chrono>
#include <thread>

#include "http_server.h"
#include "routes.h"
#include "workspace.h"

namespace vss::station {
namespace {

Status ImportAtStart(Workspace& workspace, const std::filesystem::path& product) {
  if (product.empty() || !workspace.Parts().empty()) return {};
  VSS_ASSIGN(const Product read, ReadProduct(product, workspace.image_files()));
  const auto revision = workspace.store().Apply(
      "vss", fmt::format("import {} parts of {}", read.parts.size(), product.filename().string()),
      workspace.ChangesOfProduct(read));
  if (!revision) return tl::unexpected<Error>({ErrorCode::kInternal, revision.error().message});
  return {};
}

}  // namespace

Status RunStation(const StationOptions& options, const std::function<void(const std::string&)>& opened,
                  const std::atomic<bool>& stop) {
  ServerOptions server_options;
  server_options.address = options.listen;
  server_options.port = static_cast<std::uint16_t>(options.port);
  if (!options.token_file.empty()) {
    VSS_ASSIGN(server_options.token, ReadToken(options.token_file));
  }
  VSS_ASSIGN(auto workspace, Workspace::Open(options.folder, {options.threads}));
  VSS_RETURN_IF_ERROR(ImportAtStart(*workspace, options.product));
  std::unique_ptr<Server> server;
  std::atomic<Server*> live{nullptr};
  Routes routes(*workspace, [&](const Json& message) {
    if (Server* s = live.load()) s->Broadcast(message.dump(-1, ' ', false, Json::error_handler_t::replace));
  });
  VSS_ASSIGN(server,
             Server::Start(server_options, [&](const Request& request) { return routes.Answer(request); }));
  live = server.get();
  opened(server->url());
  while (!stop) std::this_thread::sleep_for(std::chrono::milliseconds(100));
  workspace->CancelRun();
  live = nullptr;
  server->Stop();
  workspace.reset();  // waits for a run, which still tells
  return {};
}

}  // namespace vss::station
