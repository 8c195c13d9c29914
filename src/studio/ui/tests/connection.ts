// A connection alone, for connection.spec.mjs.
import { SocketConnection } from "../src/shell/socket_connection";
import { notices } from "../src/shell/notices";

const connection = new SocketConnection({ document: "d", workspace: "mesh", name: "a.ply", path: "/a.ply" });
Object.assign(window, { connection, notices });
