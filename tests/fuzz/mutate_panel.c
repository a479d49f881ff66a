/* SPDX-License-Identifier: MIT
 * mutate_panel.c - custom mutator for heave-panel: requests, heads, bodies and messages that are right or nearly are put in
 * between as records of fuzz_panel.c; the rest libFuzzer does.
 */
#include "mutate.h"

#include <string.h>

#define HOST   "Host: 127.0.0.1\r\n"
#define ORIGIN "Origin: http://127.0.0.1\r\n"
#define JSON   "Content-Type: application/json\r\n"
#define COOKIE "Cookie: heave=aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa\r\n"

/* Of strangers. */
static const char *const k_requests[] = {
    "GET / HTTP/1.1\r\n" HOST "\r\n",
    "GET /api/me HTTP/1.1\r\n" HOST "\r\n",
    "GET /api/log/ride HTTP/1.1\r\n" HOST,
    "GET /api/incident/ride/../x HTTP/1.1\r\n" HOST "\r\n",
    "GET /api/config/ride HTTP/1.1\r\n" HOST "\r\n",
    "GET /ws HTTP/1.1\r\n" HOST ORIGIN,
    "GET /",
    "POST /api/login HTTP/1.1\r\n" HOST ORIGIN JSON,
    "POST /api/logout HTTP/1.1\r\n" HOST ORIGIN JSON,
    "POST /api/check/ride HTTP/1.1\r\n" HOST ORIGIN JSON,
    "PUT /api/login HTTP/1.1\r\n" HOST ORIGIN JSON,
    "OPTIONS * HTTP/1.1\r\n" HOST "\r\n",
    "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
    HOST,
    ORIGIN,
    JSON,
    COOKIE,
    "Cookie: heave=\r\n",
    "Host: evil.example\r\n",
    "Origin: null\r\n",
    "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n",
    "Sec-WebSocket-Protocol: heave-panel.1\r\n",
    "Sec-WebSocket-Protocol: heaved\r\n",
    "Sec-WebSocket-Extensions: permessage-deflate\r\n",
    "Upgrade: h2c\r\nConnection: Upgrade, HTTP2-Settings\r\nHTTP2-Settings: AAMAAABkAAQAAP__\r\n",
    "Accept-Encoding: gzip\r\n",
    "Content-Length: 0\r\n",
    "Content-Length: 36\r\n",
    "Content-Length: -1\r\n",
    "Content-Length: 4294967296\r\n",
    "Transfer-Encoding: chunked\r\n",
    "Expect: 100-continue\r\n",
    "X-Forwarded-For: 10.0.0.1, 10.0.0.2\r\n",
    "Connection: close\r\n",
    "\r\n",
    "{\"role\":\"service\",\"password\":\"wrong\"}",
    "{\"text\":\"[platform]\\n\"}",
    "{}",
    "0\r\n\r\n",
    "24\r\n",
    "\x81\x80",
    "\x88\x80",
    "\x89\xfe\x00\x10",
    "\x01\xff",
};

/* Of a page. */
static const char *const k_messages[] = {
    "{\"op\":\"take\",\"platform\":\"ride\",\"id\":1}",
    "{\"op\":\"drop\",\"platform\":\"ride\",\"id\":2}",
    "{\"op\":\"status\",\"platform\":\"ride\",\"hz\":10}",
    "{\"op\":\"ticks\",\"platform\":\"ride\",\"on\":true}",
    "{\"op\":\"samples\",\"platform\":\"ride\",\"columns\":[\"t_ms\"],\"every\":10,\"id\":3}",
    "{\"op\":\"samples-end\",\"platform\":\"ride\",\"stream\":1}",
    "{\"op\":\"request\",\"platform\":\"ride\",\"line\":\"hold\",\"id\":4}",
    "{\"op\":\"request\",\"platform\":\"ride\",\"line\":\"engage\",\"tick\":1,\"id\":5}",
    "{\"op\":\"request\",\"platform\":\"ride\",\"line\":\"reset\",\"tick\":1,\"id\":6}",
    "{\"op\":\"request\",\"platform\":\"ride\",\"line\":\"watch 5\",\"id\":7}",
    "{\"op\":\"press\",\"platform\":\"ride\",\"line\":\"jog 1 2\",\"tick\":1,\"id\":8}",
    "{\"op\":\"beat\",\"platform\":\"ride\",\"series\":7,\"counter\":1,\"tick\":1}",
    "{\"op\":\"release\",\"platform\":\"ride\",\"id\":9}",
    "{\"op\":\"identify\",\"platform\":\"ride\",\"axis\":\"z\",\"tick\":1,\"id\":10}",
    "{\"op\":\"configure\",\"platform\":\"ride\",\"base\":\"0\",\"staged\":\"0\",\"id\":11}",
    "{\"op\":\"none\",\"platform\":\"none\",\"id\":1e300}",
    "[]",
    "{\"id\":-1}",
};

size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t max_size, unsigned seed)
{
    mutate_t random = mutate_start(seed);
    uint8_t record[320] = {0};
    size_t at = 0;
    if (mutate_below(&random, 4) == 0) {
        return LLVMFuzzerMutate(data, size, max_size);
    }
    for (size_t skip = mutate_below(&random, 16); skip > 0 && at + 3 <= size; skip--) { /* behind some whole records */
        const uint8_t op = data[at] % 8;
        at += 3 + (op >= 4 && op <= 6 ? 0u : op == 3 ? data[at + 2] * 16u : data[at + 2]);
    }
    at = at < size ? at : size;
    record[1] = (uint8_t)mutate_below(&random, 3);
    const size_t what = mutate_below(&random, 8);
    if (what == 0) {
        record[0] = (uint8_t)(4 + mutate_below(&random, 3));
        return mutate_insert(data, size, max_size, at, record, 3);
    }
    const char *const text = what < 3 ? k_messages[mutate_below(&random, sizeof k_messages / sizeof k_messages[0])]
                                      : k_requests[mutate_below(&random, sizeof k_requests / sizeof k_requests[0])];
    const size_t length = strlen(text);
    record[0] = mutate_below(&random, 2) == 0 ? 7 : 0;
    record[2] = (uint8_t)length;
    memcpy(record + 3, text, length);
    return mutate_insert(data, size, max_size, at, record, 3 + length);
}
