"""Where goals come from: interest maps and what they are compared with (section 3.2.1)."""
