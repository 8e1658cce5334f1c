// Swing the target of the coupling "tool" by 5 mm at 1 Hz on the first axis, and say twice a second what came of it.
// Debian: apt install g++ libzmq3-dev nlohmann-json3-dev
// Build:  g++ -std=c++17 -o drive drive.cpp -lzmq
#include <chrono>
#include <cmath>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>
#include <zmq.h>

using nlohmann::json;

void* connect(void* context, int kind, const std::string& endpoint) {
    void* socket = zmq_socket(context, kind);
    const int latest = 1;
    zmq_setsockopt(socket, ZMQ_CONFLATE, &latest, sizeof latest);  // of what waits, the latest counts
    if (kind == ZMQ_SUB) zmq_setsockopt(socket, ZMQ_SUBSCRIBE, "", 0);
    if (zmq_connect(socket, endpoint.c_str()) != 0) throw std::runtime_error(zmq_strerror(zmq_errno()));
    return socket;
}

json receive(void* socket, int flags) {
    char bytes[65536];
    const int size = zmq_recv(socket, bytes, sizeof bytes, flags);
    return size < 0 ? json() : json::from_msgpack(bytes, bytes + size);
}

int main(int argc, char** argv) {
    const std::string directory = argc > 1 ? argv[1] : "/run/hapticd/default";
    void* context = zmq_ctx_new();
    void* scene = connect(context, ZMQ_DEALER, "ipc://" + directory + "/scene");
    void* state = connect(context, ZMQ_SUB, "ipc://" + directory + "/state");

    for (long seq = 1;; ++seq) {
        const json now = receive(state, 0);  // the newest tick; waits for one that is newer than the last
        std::vector<double> position(now["position_m"].size(), 0.0), velocity(position);
        const double turn = 2 * M_PI * now["timestamp"].get<double>();
        position[0] = 0.005 * std::sin(turn);
        velocity[0] = 0.005 * 2 * M_PI * std::cos(turn);
        const auto sent = std::chrono::steady_clock::now().time_since_epoch();
        const auto message = json::to_msgpack({
            {"name", "tool"}, {"seq", seq}, {"sent_ns", std::chrono::nanoseconds(sent).count()},
            {"state_seq", now["seq"]}, {"position_m", position}, {"velocity_m_per_s", velocity}});
        zmq_send(scene, message.data(), message.size(), ZMQ_DONTWAIT);

        const json refusal = receive(scene, ZMQ_DONTWAIT);
        if (refusal.is_object()) std::cout << "refused: " << refusal["text"].get<std::string>() << std::endl;
        const json tool = now["ports"].value("tool", json());
        if (seq % 100 == 0 && tool.is_object())
            std::cout << "tick " << now["seq"] << " message " << tool["seq"] << " in force, of " << seq << ", force "
                      << tool["force_n"][0] << std::endl;
    }
}
