"""Looking at runs: tables, reports, films, TensorBoard, the demo."""
