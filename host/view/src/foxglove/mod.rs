//! The log's messages for other viewers, over the public protocol `foxglove.websocket.v1`.
