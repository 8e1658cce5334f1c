// Print the position twice a second, every cycle and every event.
// Debian: apt install g++ libzmq3-dev nlohmann-json3-dev
// Build:  g++ -std=c++17 -o subscribe subscribe.cpp -lzmq
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <zmq.h>

std::string receive(void* socket) {
    zmq_msg_t frame;
    zmq_msg_init(&frame);
    if (zmq_msg_recv(&frame, socket, 0) < 0) throw std::runtime_error(zmq_strerror(zmq_errno()));
    std::string bytes(static_cast<char*>(zmq_msg_data(&frame)), zmq_msg_size(&frame));
    zmq_msg_close(&frame);
    return bytes;
}

int main(int argc, char** argv) {
    void* socket = zmq_socket(zmq_ctx_new(), ZMQ_SUB);
    for (std::string topic : {"hapticd/position", "hapticd/cycle", "hapticd/event"})
        zmq_setsockopt(socket, ZMQ_SUBSCRIBE, topic.data(), topic.size());
    if (zmq_connect(socket, argc > 1 ? argv[1] : "ipc:///run/hapticd/default/telemetry") != 0) return 1;

    long last = -1;
    while (true) {
        const std::string topic = receive(socket), payload = receive(socket);
        for (const auto& tick : nlohmann::json::from_msgpack(payload)) {
            const long seq = tick["seq"];
            if (topic == "hapticd/position") {
                if (last >= 0 && seq > last + 1) std::cout << "lost " << seq - last - 1 << " ticks" << std::endl;
                last = seq;
                if (seq % 500 == 0)
                    std::cout << "tick " << seq << " position " << tick["position_m"] << " force "
                              << tick["force_n"] << std::endl;
            } else if (topic == "hapticd/cycle") {
                std::cout << "cycle " << tick["cycle"] << " generated " << tick["generated_j"] << std::endl;
            } else {
                std::cout << "event " << tick["code"] << " " << tick["text"].get<std::string>() << std::endl;
            }
        }
    }
}
