#include "pipeline/view/view_server.h"

#include <fmt/format.h>
#include <httplib.h>
#include <sys/random.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/base/json.h"
#include "io/process/interrupt.h"
#include "pipeline/film/scene_json.h"
#include "pipeline/stages/training_watch.h"
#include "pipeline/view/page_assets.h"
#include "pipeline/view/view_answers.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;
using httplib::Request;
using httplib::Response;
using io::Json;

// Connections that are served at once; more wait. A slow one gives its place back after kPatience_s.
constexpr std::size_t kConnections = 16;
constexpr int kPatience_s = 5;
constexpr std::size_t kMaxBody = 1 << 20;
constexpr std::size_t kMaxPathFile = std::size_t{64} << 20;

std::string RandomToken() {
  std::array<unsigned char, 16> bytes;
  if (getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()))
    throw io::Error(io::ExitCode::kNoResources, "no random numbers for the page's token");
  std::string token;
  for (const unsigned char byte : bytes) token += fmt::format("{:02x}", byte);
  return token;
}

void Replace(const std::string& what, const std::string& with, std::string* text) {
  const std::size_t place = text->find(what);
  if (place != std::string::npos) text->replace(place, what.size(), with);
}

void Refuse(int status, const std::string& why, Response* response) {
  response->status = status;
  response->set_content(why + "\n", "text/plain; charset=utf-8");
}

void Send(const Json& json, Response* response) {
  // Names of files may not be UTF-8.
  response->set_content(io::DumpJson(json), "application/json");
}

void SendJpeg(const std::vector<std::uint8_t>& jpeg, Response* response) {
  response->set_content(reinterpret_cast<const char*>(jpeg.data()), jpeg.size(), "image/jpeg");
}

// Compares all of it, so that the time tells nothing.
bool IsToken(const std::string& given, const std::string& token) {
  unsigned differs = given.size() != token.size();
  for (std::size_t i = 0; i < token.size(); ++i)
    differs |= static_cast<unsigned>(token[i] ^ (i < given.size() ? given[i] : 0));
  return differs == 0;
}

}  // namespace

struct ViewServer::Serving {
  LiveRun* run;
  FrameMaker* maker;
  std::string token;
  std::vector<std::string> hosts;  // as a browser names this server
  httplib::Server server;
  std::thread thread;

  // Whether the request may be answered; otherwise it is refused here.
  bool Admits(const Request& request, Response* response) const;
  void SendPage(Response* response) const;
  void SendFrame(const Request& request, Response* response) const;
  void Route();
};

bool ViewServer::Serving::Admits(const Request& request, Response* response) const {
  const std::string host = request.get_header_value("Host");
  if (std::find(hosts.begin(), hosts.end(), host) == hosts.end()) {
    Refuse(403, "another host's name", response);
    return false;
  }
  if (request.has_header("Origin") && request.get_header_value("Origin") != "http://" + host) {
    Refuse(403, "a request from another page", response);
    return false;
  }
  const std::string given =
      request.has_header("X-Token") ? request.get_header_value("X-Token") : request.get_param_value("token");
  if (!IsToken(given, token)) {
    Refuse(403, "open the address that `pipeline view` printed", response);
    return false;
  }
  return true;
}

void ViewServer::Serving::SendPage(Response* response) const {
  const std::string nonce = RandomToken();
  std::string page = kViewPage;
  Replace("{{STYLE}}", kViewStyle, &page);
  Replace("{{SCRIPT}}", kViewScript, &page);
  for (int i = 0; i < 2; ++i) Replace("{{NONCE}}", nonce, &page);
  response->set_header("Content-Security-Policy",
                       "default-src 'none'; img-src blob: data:; connect-src 'self'; frame-ancestors 'none'; "
                       "base-uri 'none'; style-src 'nonce-" +
                           nonce + "'; script-src 'nonce-" + nonce + "'");
  response->set_content(page, "text/html; charset=utf-8");
}

void ViewServer::Serving::SendFrame(const Request& request, Response* response) const {
  const FrameRequest wanted =
      ParseFrameRequest([&](const std::string& name) { return request.get_param_value(name.c_str()); });
  const LiveRun::Content content = run->Now();
  const std::optional<ViewFrame> frame = maker->Make(wanted, content);
  if (!frame) {
    response->status = 204;
    return;
  }
  response->set_header("X-Render-Ms", fmt::format("{:.1f}", frame->render_ms));
  response->set_header("X-Version", std::to_string(content.version));
  SendJpeg(frame->jpeg, response);
}

void ViewServer::Serving::Route() {
  server.set_pre_routing_handler([this](const Request& request, Response& response) {
    return Admits(request, &response) ? httplib::Server::HandlerResponse::Unhandled
                                      : httplib::Server::HandlerResponse::Handled;
  });
  server.set_exception_handler([](const Request&, Response& response, const std::exception_ptr& thrown) {
    try {
      std::rethrow_exception(thrown);
    } catch (const io::Interrupted&) {
      Refuse(503, "ending", &response);
    } catch (const io::Error& error) {
      Refuse(error.code() == io::ExitCode::kBadInput ? 400 : 500, error.what(), &response);
    } catch (const std::exception& error) {
      Refuse(500, error.what(), &response);
    }
  });
  server.Get("/", [this](const Request&, Response& response) { SendPage(&response); });
  server.Get("/scene", [this](const Request&, Response& response) {
    const LiveRun::Content content = run->Now();
    if (!content.scene) return Refuse(404, "no poses yet", &response);
    Send(SceneJson(*content.scene, run->run_folder().filename().string()), &response);
  });
  server.Get("/state", [this](const Request&, Response& response) { Send(StateJson(*run), &response); });
  server.Get("/frame", [this](const Request& request, Response& response) { SendFrame(request, &response); });
  server.Get("/photo", [this](const Request& request, Response& response) {
    SendJpeg(PhotoJpeg(run->Now(), request.get_param_value("index")), &response);
  });
  server.Get("/path", [this](const Request&, Response& response) {
    const fs::path file = run->run_folder() / "camera_path.json";
    response.set_content(fs::is_regular_file(file) ? io::ReadFile(file, kMaxPathFile) : "{}",
                         "application/json");
  });
  server.Post("/path", [this](const Request& request, Response& response) {
    Send(AnswerPath(run->run_folder(), request.body, request.get_param_value("save") == "1"), &response);
  });
  server.Post("/end", [this](const Request&, Response& response) {
    AskToEnd(run->run_folder());
    Send({{"asked", true}}, &response);
  });
}

ViewServer::ViewServer(LiveRun* run, FrameMaker* maker, const ServerAddress& address)
    : serving_(std::make_unique<Serving>()), host_(address.host), token_(RandomToken()) {
  serving_->run = run;
  serving_->maker = maker;
  serving_->token = token_;
  httplib::Server& server = serving_->server;
  server.new_task_queue = [] { return new httplib::ThreadPool(kConnections); };
  server.set_read_timeout(kPatience_s);
  server.set_write_timeout(kPatience_s);
  server.set_keep_alive_timeout(kPatience_s);
  server.set_payload_max_length(kMaxBody);
  server.set_default_headers({{"Cache-Control", "no-store"},
                              {"X-Content-Type-Options", "nosniff"},
                              {"Referrer-Policy", "no-referrer"},
                              {"Cross-Origin-Resource-Policy", "same-origin"}});
  // The library's own choice, SO_REUSEPORT, would share a port that another program listens at.
  server.set_socket_options([](socket_t socket) {
    const int yes = 1;
    setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  });
  port_ = address.port;
  if (port_ == 0) {
    port_ = server.bind_to_any_port(host_.c_str());
  } else if (!server.bind_to_port(host_.c_str(), port_)) {
    port_ = -1;
  }
  if (port_ < 0)
    throw io::Error(io::ExitCode::kNoResources,
                    fmt::format("{}:{} cannot be listened at", host_, address.port),
                    "Choose another --port or --host");
  serving_->hosts = {fmt::format("{}:{}", host_, port_), fmt::format("localhost:{}", port_)};
  serving_->Route();
  serving_->thread = std::thread([this] { serving_->server.listen_after_bind(); });
}

ViewServer::~ViewServer() {
  // stop() has no effect on a server that has not begun.
  while (!serving_->server.is_running()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  serving_->server.stop();
  serving_->thread.join();
}

std::string ViewServer::Url() const { return fmt::format("http://{}:{}/?token={}", host_, port_, token_); }

}  // namespace pipeline
