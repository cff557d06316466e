// The page in a browser: the studio over a socket that connects again when the program was restarted.

import { unpacked } from "./dom.js";
import { mount } from "./studio.js";

function socketLink() {
  const link = {};
  let socket = null;
  let wait = 300;
  const connect = () => {
    const address = new URL("live", location.href);
    address.protocol = "ws:";
    address.hash = "";
    socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      wait = 300;
      link.onstate(true);
    };
    socket.onmessage = (event) => {
      const { head, arrays } = unpacked(event.data);
      link.onmessage(head, arrays);
    };
    socket.onclose = (event) => {
      link.onstate(false, event.reason);
      setTimeout(connect, wait);
      wait = Math.min(2 * wait, 3000);
    };
  };
  link.send = (request) => {
    if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(request));
  };
  link.connect = connect;
  return link;
}

const link = socketLink();
mount(document.getElementById("studio"), link, { hash: true });
link.connect();
