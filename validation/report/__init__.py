"""Tables, findings and figures for people: terminal, HTML, Markdown and LaTeX."""
