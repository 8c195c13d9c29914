// A fault in the code of a workspace stays in its tab; the document is with the server and loses nothing.
import { Component, type ComponentChildren } from "preact";
import { Button, Icon } from "./components";

export class Boundary extends Component<{ children: ComponentChildren }, { error: Error | null }> {
  override state = { error: null as Error | null };

  override componentDidCatch(error: Error) {
    console.error(error);
    this.setState({ error });
  }

  override render() {
    const { error } = this.state;
    if (!error) return this.props.children;
    return (
      <Message icon="error" title="This view has failed" text="The document is safe: plumbline keeps every step of it.">
        <p class="mono">{String(error.message || error)}</p>
        <Button kind="primary" onClick={() => this.setState({ error: null })}>Show it again</Button>
      </Message>
    );
  }
}

/** A text instead of a view. */
export function Message({ icon, title, text, children }: { icon: "error" | "warning" | "info"; title: string; text: string; children?: ComponentChildren }) {
  return (
    <main class="message-page">
      <Icon name={icon} />
      <div role="alert">
        <h1>{title}</h1>
        <p>{text}</p>
      </div>
      {children}
    </main>
  );
}
