// The page's server. Whoever can send requests here sees the capture and can end its training, so a request
// counts only with the token that the printed address carries, when it names this server as its host, and
// when it comes from this server's own page. Nothing but the page and what the run itself names is ever sent.
//
//   GET  /                    the page
//   GET  /scene               cameras and what they look at; 404 before there are poses
//   GET  /state               what is shown, how training goes; at least once a second from an open page
//   GET  /frame?viewer=&sequence=&pose=&fov=&width=&height=&layer=&quality=&crop=
//                             JPEG, with a crop box ("crop" of camera_path.json) only what lies inside; 204
//                             when a later request of the same viewer came first
//   GET  /photo?index=        JPEG of the scene's frame
//   GET  /path                RUN/camera_path.json, or {}
//   POST /path                keyframes as camera_path.json; answers with the interpolated frames, and writes
//                             the file with save=1
//   POST /end                 asks training to end with what there is
#pragma once

#include <memory>
#include <string>

#include "pipeline/view/frame_maker.h"
#include "pipeline/view/live_run.h"

namespace httplib {
class Server;
}

namespace pipeline {

struct ServerAddress {
  std::string host = "127.0.0.1";
  int port = 0;  // 0: any that is free
};

class ViewServer {
 public:
  // Binds the port. Throws kNoResources when it is taken or the address is not this computer's.
  ViewServer(LiveRun* run, FrameMaker* maker, const ServerAddress& address);
  ~ViewServer();  // ends the connections

  // With the token.
  std::string Url() const;
  const std::string& token() const { return token_; }
  int port() const { return port_; }

 private:
  struct Serving;
  std::unique_ptr<Serving> serving_;
  std::string host_, token_;
  int port_ = 0;
};

}  // namespace pipeline
